"""An equation that a network may obey in place of the right one, and when it explains a network."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.diagnosis.backup import Agreement, Backup
from keras_pendulum.diagnosis.signals import Array

RIGHT = "r + γ·max Q(s′, ·)"
NextAction = Callable[[Array, np.random.RandomState], NDArray[np.intp]]


@dataclass(frozen=True)
class Equation:
    """A wrong equation, and what to say where a network obeys it.

    The defaults of the limits hold for an equation in which the torque matters.
    """

    name: str  # of the finding
    variant: str
    formula: str
    target: Callable[[Backup], Array]  # returns [N, A]
    explanation: str = ""  # two sentences; empty takes those of the name
    remedy: str = ""
    largest_error: float = 0.25
    share: float = 0.88  # of the right equation's error that it may have at most
    flat: float = 0.0  # above 0: the advantages of Q are at most this share of the right ones
    like_short_training: bool = False  # whether right values that have not converged look like it
    offset: bool = False  # whether Q - r has shown it, in which it has no next values
    change: dict[str, Any] | None = None  # arguments of `changed_backup`
    label: str = ""  # what differs from the declared task
    discount: float | None = None  # γ, where it differs
    slope: float | None = None  # of the values over the exact ones, where it says one
    # The next action whose value the target takes: from Q-values [N, A] to indices [N].
    next_action: NextAction | None = None

    def explains(self, own: Agreement, right: Agreement, ends: bool = False) -> bool:
        """Returns whether the network obeys this equation clearly better than the right one.

        `ends` says whether episodes of the task terminate.
        """
        if ends and not self.offset and not self.flat:
            return self._explains_ends(own, right)
        if own.error > min(self.largest_error, self.share * right.error):
            return False
        if self.offset:
            return True
        if self.change is not None and own.mean > 0:
            return False  # no reward of the pendulum is positive, whatever its gravity
        if self.like_short_training and own.error > _SATISFIED:
            is_far = own.error < 0.45 * right.error
            is_far = is_far and own.correlation > min(right.correlation, 0.5)
            is_learned = right.correlation > 0.6 and own.correlation > right.correlation + 0.06
            if not (is_far or is_learned):
                return False
        if self.change is None and not 0.8 < own.position < 1.35:
            return False
        if self.flat == np.inf:
            return right.correlation > _REVERSED
        if self.flat:
            return own.advantages <= self.flat and _REVERSED < right.correlation < 0.65
        return own.correlation > (0.4 if self.variant else 0.3) or own.error < 0.03

    def _explains_ends(self, own: Agreement, right: Agreement) -> bool:
        """Returns the same for a task whose episodes terminate: its values show more."""
        error, share, correlation = _LIMITS_WITH_ENDS.get(self.name, (0.2, 0.5, 0.8))
        if self.variant:
            share = min(share, self.share)
            if own.correlation > 0.95 and right.correlation < 0.5:
                error = 2 * error  # the advantages leave no doubt
        if own.error > min(error, share * right.error) or own.correlation < correlation:
            return False
        if self.name == "missing-end":
            return own.at_ends > 0.9
        if self.name == "torque-map":
            return right.correlation < -0.6
        if self.name == "observation-map":
            return right.correlation < 0.5
        return True


def percent(error: float) -> str:
    """Returns an error as a text."""
    return f"{error:.0%}".replace("%", " %") if error < 10 else "more than 1000 %"


_SATISFIED = 0.04  # an error that leaves no doubt
_REVERSED = -0.3  # correlation of the advantages with the right ones: that of reversed torques

# The largest error, its share of the right equation's error, and the least correlation.
_LIMITS_WITH_ENDS = {
    "other-discount": (0.3, 0.4, 0.8),
    "reward-scale": (0.3, 0.35, 0.8),
    "reward-sign": (0.3, 0.5, 0.8),
    "torque-map": (0.4, 0.6, 0.8),
    "observation-map": (0.3, 0.5, 0.6),
    "missing-end": (0.25, 0.5, -1.0),
}
