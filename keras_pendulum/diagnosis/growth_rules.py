"""The rules for values of CartPole that grow without bound.

Each returns a finding, or None. `findings` says where the limits come from.
"""

from __future__ import annotations

from keras_pendulum.diagnosis.equation import RIGHT, percent
from keras_pendulum.diagnosis.equation_rules import HEALTHY
from keras_pendulum.diagnosis.faults import Fault, Finding
from keras_pendulum.diagnosis.measurement import Measurement

_GROWN = 3.0  # spreads above the best possible value
_FOLLOWED = 0.6  # error of values that grow also beyond ends
_UNRELATED = 0.5  # error of the right equation
_SAME = 0.12  # spread of values that are nearly the same, as a share of their mean


def growth_beyond_ends(m: Measurement) -> Finding | None:
    """Finds values that grew without bound, also where an episode ends.

    Where ends are stored, the values of the last steps stay near their reward when others grow.
    """
    if m.task.never_terminates or not m.finite or m.excess < _GROWN:
        return None
    right = m.right_agreement
    for own, equation in m.agreements:
        beyond = equation.name == "missing-end" and own.at_ends > 0.9
        if beyond and own.error < min(_FOLLOWED, 0.6 * right.error):
            evidence = (
                f"values of {m.backup.q.mean():.2g}, and {percent(own.at_ends)} of it in the last "
                f"step of an episode; they satisfy {equation.formula} to {percent(own.error)} and "
                f"{RIGHT} to {percent(right.error)}"
            )
            return Finding("missing-end", evidence, HEALTHY)
    return None


def growth_everywhere(m: Measurement) -> Finding | None:
    """Finds values that grew without bound, but are nearly the same in all states.

    Other values that grow differ from state to state, and each follows those of its next states.
    """
    if m.task.never_terminates or not m.finite or m.excess < _GROWN:
        return None
    values, error = m.backup.offset, m.right_agreement.error
    at_ends = float(m.backup.q[~m.backup.continues].mean()) if not m.backup.continues.all() else 0.0
    mean, spread = float(values.mean()), float(values.std())
    if error < _UNRELATED or spread > _SAME * mean or at_ends > 0.85 * mean:
        return None
    evidence = (
        f"values of {mean:.2g} that differ by {percent(spread / mean)} from state to state, where "
        f"the episode goes on; they satisfy {RIGHT} to {percent(error)}"
    )
    text = Fault(
        "The target takes one maximum for the whole batch, so the best state of the batch follows "
        "on every state. Its error grows with each copy of the target network.",
        "Give the maximum its axis: max(axis=1) of [B, A] is [B].",
    )
    return Finding("wrong-target", evidence, HEALTHY, variant="batch-max", text=text)
