"""The equations that a network may obey: the right one, and one for each wrong target or loss.

The dynamics and the rewards of the pendulum are known, and a trained network is near a fixed point
of the equation that its program used. So the network itself shows this equation: its values are put
into both sides, at the states that it visits and for all torques, and the sides are compared.

An equation is added here, and nowhere else.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from keras_pendulum.diagnosis.backup import Agreement, Backup, Visited, agreement
from keras_pendulum.diagnosis.signals import Array, line_fit
from keras_pendulum.diagnosis.states import observation_changes

RIGHT = "r + γ·max Q(s′, ·)"
_GRAVITIES = (0.0, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0)  # m/s²
_DISCOUNTS = (0.3, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99, 0.995)


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
    offset: bool = False  # whether it has no next values, and Q - r is as it says
    change: dict[str, Any] | None = None  # arguments of `Visited.backup`
    label: str = ""  # what differs from the declared task

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
        if self.change is None and not 0.8 < own.position < 1.35:
            return False
        if self.flat == np.inf:
            return True
        if self.flat:
            # A negative correlation is that of reversed torques.
            return own.advantages <= self.flat and -0.3 < right.correlation < 0.65
        return own.correlation > (0.4 if self.variant else 0.3) or own.error < 0.03

    def _explains_ends(self, own: Agreement, right: Agreement) -> bool:
        """Returns the same for a task whose episodes terminate: its values show more."""
        error, share, correlation = _LIMITS_WITH_ENDS.get(self.name, (0.2, 0.5, 0.8))
        if own.error > min(error, share * right.error) or own.correlation < correlation:
            return False
        if self.name == "missing-end":
            return own.at_ends > 0.9
        if self.name == "torque-map":
            return right.correlation < -0.6
        if self.name == "observation-map":
            return right.correlation < 0.5
        return True


# The largest error, its share of the right equation's error, and the least correlation.
_LIMITS_WITH_ENDS = {
    "other-discount": (0.3, 0.4, 0.8),
    "reward-scale": (0.3, 0.35, 0.8),
    "reward-sign": (0.3, 0.5, 0.8),
    "torque-map": (0.4, 0.6, 0.8),
    "observation-map": (0.3, 0.5, 0.6),
    "missing-end": (0.25, 0.5, -1.0),
}


def agreements(visited: Visited, declared: Backup) -> Iterator[tuple[Agreement, Equation]]:
    """Yields all wrong equations, each with how well the values agree with it.

    Args:
        visited: the network.
        declared: its values for the declared task.
    """
    ends = not visited.dynamics.task.never_terminates
    found = (each for each in (_with_ends if ends else _offsets)(declared) if each.offset)
    equations = [each for each in EQUATIONS if not ends or each.variant != "same-state"]
    for equation in (*equations, *found, *_changes(visited, declared)):
        values = visited.backup(**equation.change) if equation.change else declared
        yield agreement(values, equation.target(values)), equation


def _next(values: Callable[[Array], Array]) -> Callable[[Backup], Array]:
    """Returns a target: r + γ · these of the next values."""
    return lambda b: b.reward + b.future * values(b.next_q)


_TARGET = "Its fixed point has other values, so the greedy policy follows another task."
_TAKE_MAXIMUM = "Take the maximum over the actions: axis 1 of [B, A], of the next state's values."

_ZERO_OTHERS = Equation(
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

EQUATIONS = (
    Equation(
        "wrong-target",
        "mean-next",
        "r + γ·mean Q(s′, ·)",
        _next(lambda q: q.mean(axis=2)),
        f"The target takes the mean of the next values, not their maximum. {_TARGET}",
        _TAKE_MAXIMUM,
    ),
    Equation(
        "wrong-target",
        "min-next",
        "r + γ·min Q(s′, ·)",
        _next(lambda q: q.min(axis=2)),
        f"The target takes the lowest of the next values, not the highest. {_TARGET}",
        f"{_TAKE_MAXIMUM} Of costs take the minimum, but then act by the lowest value, too.",
    ),
    Equation(
        "wrong-target",
        "fixed-action-next",
        "r + γ·Q(s′, first action)",
        _next(lambda q: q[:, :, 0]),
        f"The target takes the value of the first action, whatever the next state is. {_TARGET}",
        f"{_TAKE_MAXIMUM} An index [0] in place of max does this.",
    ),
    Equation(
        "wrong-target",
        "fixed-action-next",
        "r + γ·Q(s′, last action)",
        _next(lambda q: q[:, :, -1]),
        f"The target takes the value of the last action, whatever the next state is. {_TARGET}",
        f"{_TAKE_MAXIMUM} An index [-1] in place of max does this.",
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
    _ZERO_OTHERS,
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


def _offsets(declared: Backup) -> Iterator[Equation]:
    """Yields the equations in which a constant takes the place of the next values."""
    offset, last = declared.offset, declared.q.shape[1] - 1
    mean = float(offset.mean())
    small = 0.06 < offset.std() < 0.25 * declared.q.std()
    frozen = bool(small and declared.offset_is_smooth and -0.1 < mean < 2)
    line = line_fit(declared.q, declared.reward)
    usual = 0.6 < line.slope < 1.3
    # No reward is positive, so no other target adds positive numbers that differ.
    indices = bool(np.mean((offset > -2) & (offset < declared.discount * last + 1)) > 0.8)
    rewards = line.correlation > 0.7 and 0.45 < line.slope < 1.8
    indices = indices and (rewards or float(declared.q.mean()) > 1)
    indices = indices and not frozen and mean > 0.3 and float(offset.std()) > 0.2
    found = {
        "no-bootstrapping": usual and not frozen and abs(mean) < 0.1,
        "frozen-target": usual and frozen,
        "batch-max": usual and not frozen and not indices and abs(mean) >= 0.1,
        "index-for-value": indices,
    }
    for equation in _offset_equations(declared):
        yield replace(equation, offset=found[equation.variant or equation.name])


def _offset_equations(declared: Backup) -> Iterator[Equation]:
    def constant(b: Backup) -> Array:
        return b.reward + b.offset.mean() * b.continues

    last = declared.q.shape[1] - 1
    yield Equation("no-bootstrapping", "", "r", lambda b: b.reward, share=0.2)
    yield Equation(
        "wrong-target",
        "frozen-target",
        "r + a small constant",
        constant,
        "The values are the rewards of one step plus a little that changes slowly with the next "
        "state. That is γ·max of a network that never learns: the target network is never copied.",
        "Copy the online weights into the target network, every 100 to 1000 updates or a little at "
        "each one.",
        share=0.2,
    )
    yield Equation(
        "wrong-target",
        "batch-max",
        "r + a constant",
        constant,
        "The values are the rewards of one step plus a constant: the target takes one maximum for "
        "the whole batch. So the best state of the batch follows on every state.",
        "Give the maximum its axis: max(axis=1) of [B, A] is [B].",
        largest_error=0.1,
        share=0.2,
    )
    yield Equation(
        "wrong-target",
        "index-for-value",
        f"r + γ·(an index from 0 to {last})",
        constant,
        "The values are the rewards of one step plus numbers between 0 and A - 1. The target adds "
        "the index of the best next action, which argmax returns, and not its value.",
        "Use max in the target; argmax is for acting.",
        largest_error=1.2,
    )


def _with_ends(declared: Backup) -> Iterator[Equation]:
    """Yields the same for a task whose reward is constant: then Q - r alone shows them.

    There, the shares of the actions in the batches differ from state to state. But their sum is 1.
    """
    offset, last = declared.offset, declared.q.shape[1] - 1
    mean, spread = float(offset.mean()), float(offset.std())
    size = float(np.abs(declared.reward).mean())
    end = float(declared.q[~declared.continues].mean()) if not declared.continues.all() else size
    none = abs(mean) < 0.03 * size and spread < 0.05 * size
    small = (
        not none and spread < 0.5 * size and -0.3 * size < mean < last * declared.discount + 0.15
    )
    # The values of a network that has never learned are smooth, and smaller.
    index = small and (mean > 0.5 * size or (mean > 0 and not declared.offset_is_smooth))
    for equation in _offset_equations(declared):
        offsets = {
            "no-bootstrapping": none,
            "frozen-target": small and not index,
            "index-for-value": index,
            "batch-max": mean > 2 * size and spread < 0.12 * mean and end < 0.5 * mean,
        }
        name = equation.variant or equation.name
        equation = replace(equation, offset=offsets[name], largest_error=1.6)
        yield _highest_everywhere(equation) if name == "batch-max" else equation
    lowest, highest = float(np.quantile(declared.q.min(axis=1), 0.25)), float(declared.q.max())
    yield replace(
        _ZERO_OTHERS,
        formula="sum of Q(s, ·) / (r + γ·max Q(s′, ·)) = 1",
        target=lambda b: b.q / (b.q / b.right).sum(axis=1, keepdims=True),
        share=0.35,
        offset=lowest < 0.9 * size and highest > 2.5 * size,
    )


def _highest_everywhere(equation: Equation) -> Equation:
    """Returns `batch-max` for a constant reward: there, `same-state` has the same values."""
    return replace(
        equation,
        variant="batch-max or same-state",
        share=0.5,
        explanation="All values are nearly the highest possible one, but not those of a step that "
        "ends the episode. Either the target takes one maximum for the whole batch, or the values "
        "of the state itself in place of the next one.",
        remedy="Give the maximum its axis: max(axis=1) of [B, A] is [B]. And store (s, a, r, s′) "
        "before s = s′.",
    )


def _changes(visited: Visited, declared: Backup) -> Iterator[Equation]:
    """Yields the right equation with other rewards, tasks, torques and observations."""
    factor = declared.reward_factor
    if factor < -0.2 or not 0.2 < factor < 2.5:
        yield Equation(
            "reward-sign" if factor < -0.05 else "reward-scale",
            "",
            f"{factor:.3g}·r + γ·max Q(s′, ·)",
            lambda b: b.right + (factor - 1) * b.reward,
            largest_error=0.12,
            share=0.75,
        )
    for discount in _DISCOUNTS:
        if abs(discount - visited.discount) > 0.25 * (1 - visited.discount):
            yield Equation(
                "other-discount",
                "",
                f"r + {discount:g}·max Q(s′, ·)",
                partial(_discounted, discount),
                largest_error=0.07,
                share=0.4,
            )
    error = declared.q - declared.right
    # Values that are above their targets everywhere are still falling, from about 0.
    falling = error.mean() > 0.7 * np.sqrt(np.mean(error**2))
    own = visited.dynamics.task.gravity
    for gravity in () if falling else _GRAVITIES:
        if own is not None and abs(gravity - own) > 0.3 * own:
            task = visited.dynamics.task.with_gravity(gravity)
            yield _changed("other-gravity", f"g = {gravity:g}", task=task)
    # The sign of the correlation is the main evidence.
    yield _changed(
        "torque-map", f"{visited.dynamics.effort}s reversed", share=0.95, efforts=-visited.efforts
    )
    for name in observation_changes(visited.dynamics):
        yield _changed("observation-map", name, observation=name)


def _discounted(discount: float, values: Backup) -> Array:
    return values.reward + discount * values.continues * values.next_q.max(axis=2)


def _changed(name: str, label: str, share: float = 0.75, **change: Any) -> Equation:
    """Returns the right equation of a changed backup."""
    shown = f"the observation [{label}]" if name == "observation-map" else label
    return Equation(
        name,
        "",
        f"{RIGHT} with {shown}",
        lambda b: b.right,
        share=share,
        change=change,
        label=label,
    )
