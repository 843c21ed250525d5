"""The equations of wrong targets and losses whose next values are in the target."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from keras_pendulum.diagnosis.backup import Backup
from keras_pendulum.diagnosis.equation import Equation
from keras_pendulum.diagnosis.signals import Array


def _next(values: Callable[[Array], Array]) -> Callable[[Backup], Array]:
    """Returns a target: r + γ · these of the next values."""
    return lambda b: b.reward + b.future * values(b.next_q)


_TARGET = "Its fixed point has other values, so the greedy policy follows another task."
_TAKE_MAXIMUM = "Take the maximum over the actions: axis 1 of [B, A], of the next state's values."


def _fixed_action_next(word: str, index: int) -> Equation:
    return Equation(
        "wrong-target",
        "fixed-action-next",
        f"r + γ·Q(s′, {word} action)",
        _next(lambda q: q[:, :, index]),
        f"The target takes the value of the {word} action, whatever the next state is. {_TARGET}",
        f"{_TAKE_MAXIMUM} An index [{index}] in place of max does this.",
        share=0.72,  # values that have not converged fit it, too, but not so much better
        next_action=lambda q, random: np.full(len(q), index % q.shape[1]),
    )


ZERO_OTHERS = Equation(
    "wrong-loss",
    "zero-others",
    "(r + γ·max Q(s′, ·)) / A",
    lambda b: b.right / b.q.shape[1],
    "The loss compares the outputs that did not act with zero. So each value is the target "
    "times the share of its action in the batches, about 1/A.",
    "Compare only the output of the stored action: take Q(s, a), or give the others their own "
    "values as targets.",
    largest_error=0.4,
    share=0.1,
    flat=np.inf,
)

NEGATIVE_NEXT = Equation(
    "wrong-target",
    "negative-next",
    "r - γ·max Q(s′, ·)",
    lambda b: b.reward - b.future * b.next_q.max(axis=2),
    "The target subtracts the next values, so a good next state makes a value worse.",
    "Add the next values: r + γ·max Q(s′, ·).",
    # They alternate, so they converge slowly. But no others fall where the next values rise.
    largest_error=1.5,
    share=0.45,
)

TARGETS = (
    Equation(
        "wrong-target",
        "mean-next",
        "r + γ·mean Q(s′, ·)",
        _next(lambda q: q.mean(axis=2)),
        f"The target takes the mean of the next values, not their maximum. {_TARGET}",
        _TAKE_MAXIMUM,
        # Its maximum is then still too low. `policy_rules` looks at more steps.
        like_short_training=True,
        next_action=lambda q, random: random.randint(q.shape[1], size=len(q)),
    ),
    Equation(
        "wrong-target",
        "min-next",
        "r + γ·min Q(s′, ·)",
        _next(lambda q: q.min(axis=2)),
        f"The target takes the lowest of the next values, not the highest. {_TARGET}",
        f"{_TAKE_MAXIMUM} Of costs take the minimum, but then act by the lowest value, too.",
        next_action=lambda q, random: q.argmin(axis=1),
    ),
    _fixed_action_next("first", 0),
    _fixed_action_next("last", -1),
    Equation(
        "wrong-target",
        "same-action-next",
        "r + γ·Q(s′, a)",
        lambda b: b.reward + b.future * np.diagonal(b.next_q, axis1=1, axis2=2),
        "The target takes the next value of the action that was taken before, so values are those "
        f"of an agent that never changes its action. {_TARGET}",
        f"{_TAKE_MAXIMUM} gather with the stored action is for Q(s, a) alone.",
        # Early values hardly depend on the state, so they fit, too, but not so much better.
        largest_error=0.2,
        share=0.25,
    ),
    Equation(
        "wrong-target",
        "same-state",
        "r + γ·max Q(s, ·)",
        lambda b: b.reward + b.future * b.q.max(axis=1, keepdims=True),
        "The target takes the values of the state itself, so no action has a consequence. The next "
        "state is stored as the state, or the variable is set too early.",
        "Store (s, a, r, s′) before s = s′, and copy the observation where the environment changes "
        "it in place.",
        share=0.2,
        flat=0.3,
    ),
    Equation(
        "missing-end",
        "",
        "r + γ·max Q(s′, ·), also at an end",
        lambda b: b.reward + b.discount * b.next_q.max(axis=2),
    ),
    ZERO_OTHERS,
    Equation(
        "wrong-loss",
        "same-target",
        "mean over a of r + γ·max Q(s′, ·)",
        lambda b: b.right.mean(axis=1, keepdims=True) + 0 * b.q,
        "The loss compares all outputs with the target of the one action that was taken. So the "
        "values are right on average, and the same for all actions.",
        "Compare only the output of the stored action: take Q(s, a) by gather or a mask.",
        flat=0.06,
    ),
)
