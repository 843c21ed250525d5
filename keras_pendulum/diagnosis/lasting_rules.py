"""The rules for programs that repeat each action for some steps (a frame skip).

They obey the right equation of actions that last. Over one step, their values look like those of a
wrong target.
"""

from __future__ import annotations

from keras_pendulum.diagnosis.equation import RIGHT, percent
from keras_pendulum.diagnosis.faults import Fault, Finding
from keras_pendulum.diagnosis.measurement import Measurement

_CLEARLY = 0.5  # share of the error of the right equation that actions that last have at most
_LEARNED = 0.8  # correlation of the advantages
_AS_WELL = 1.25  # times the error of a wrong equation
_TEXT = Fault(
    "The values are those of a program that repeats each action for some steps (a frame skip). "
    "Here the agent acts anew at each step, so it plays another task than the one it has learned.",
    "That is not a fault. To see how well the agent plays, hand in an object whose act repeats "
    "each action for as many steps, and whose reset forgets it.",
)


def may_last(m: Measurement, error: float) -> bool:
    """Returns whether actions that last explain the values about as well as this error."""
    return recorded_steps(m) > 1 or m.lasting_action.agreement.error < _AS_WELL * error


def clearly_last(m: Measurement) -> bool:
    """Returns whether the record or the values show that actions last for several steps."""
    right, own = m.right_agreement, m.lasting_action.agreement
    is_near = own.error < _CLEARLY * right.error
    return recorded_steps(m) > 1 or (is_near and own.correlation > max(_LEARNED, right.correlation))


def lasting_actions(m: Measurement) -> Finding | None:
    """Says that the values are those of actions that last."""
    if not (m.finite and clearly_last(m)):
        return None
    if (steps := recorded_steps(m)) > 1:
        evidence, healthy = f"each recorded action lasts for {steps} steps", "for 1 step"
    else:
        steps, own = m.lasting_action
        evidence = f"the values satisfy {RIGHT} to {percent(m.right_agreement.error)}, and with "
        evidence += f"actions that last for {steps} steps to {percent(own.error)}"
        healthy = f"{RIGHT} to 1 to 7 %"
    return Finding("not-converged", evidence, healthy, variant="lasting-actions", text=_TEXT)


def recorded_steps(m: Measurement) -> int:
    """Returns for how many steps each recorded action lasts; 1 without a recorder."""
    if m.record is None or m.record.played is None:
        return 1
    return m.record.played.action_steps()
