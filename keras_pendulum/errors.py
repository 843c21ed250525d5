"""What a user can get wrong, told in one line."""


class UserError(Exception):
    """A mistake that the user can mend. The message is one line: what was found, what to do."""


class ConfigError(UserError, ValueError):
    """A setting that no run can have."""


class WeightsError(UserError, ValueError):
    """A weights file that cannot be read, or does not hold what it should."""
