"""Errors that a user can correct; each message is one line."""


class UserError(Exception):
    """A mistake of the user. The message says what was found and what to do."""


class ConfigError(UserError, ValueError):
    """A setting with a value that no run can have."""


class WeightsError(UserError, ValueError):
    """A weights file that cannot be read, or does not hold the expected network."""
