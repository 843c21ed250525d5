"""The equations that a network may obey: the right one, and one for each wrong target or loss.

The dynamics and the rewards of the tasks are known, and a trained network is near a fixed point of
the equation that its program used. So the network itself shows this equation: its values are put
into both sides, at the states that it visits and for all actions, and the sides are compared.

A wrong target or loss is added in `target_equations` or `constant_futures`, another task or input
here, and nowhere else.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from keras_pendulum.diagnosis.backup import Agreement, Backup, agreement
from keras_pendulum.diagnosis.constant_futures import (
    constant_futures,
    constant_futures_with_ends,
)
from keras_pendulum.diagnosis.equation import RIGHT, Equation
from keras_pendulum.diagnosis.faults import ADDED_CONSTANT
from keras_pendulum.diagnosis.played_agent import PlayedAgent
from keras_pendulum.diagnosis.signals import Array
from keras_pendulum.diagnosis.states import observation_changes
from keras_pendulum.diagnosis.target_equations import TARGETS

_GRAVITIES = (0.0, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0)  # m/s²
_DISCOUNTS = (0.3, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99, 0.995, 1.0)


def agreements(
    agent: PlayedAgent, declared: Backup, changed_backup: Callable[..., Backup]
) -> Iterator[tuple[Agreement, Equation]]:
    """Yields all wrong equations, each with how well the values agree with it.

    Args:
        agent: the agent.
        declared: its values for the declared task.
        changed_backup: returns its values for another task.
    """
    ends = not agent.task.never_terminates
    found = (constant_futures_with_ends if ends else constant_futures)(declared)
    # With ends, `constant_futures_with_ends` finds it.
    equations = [each for each in TARGETS if not (ends and each.variant == "same-state")]
    for equation in (*equations, *found, *_changes(agent, declared)):
        values = changed_backup(**equation.change) if equation.change else declared
        yield agreement(values, equation.target(values)), equation


def _changes(agent: PlayedAgent, declared: Backup) -> Iterator[Equation]:
    """Yields the right equation with other rewards, tasks, torques and observations."""
    factor = declared.reward_factor
    factor = 0.0 if -0.05 < factor < 0 else factor  # so small that its sign says nothing
    goes_on = agent.task.never_terminates
    # Smaller rewards below 0 leave no value above 0.
    too_high = goes_on and factor > 0 and float(np.mean(declared.q > 0)) > 0.9
    if factor < -0.2 or not (too_high or 0.2 < factor < 2.5):
        # No reward of the pendulum is positive, so positive values are strong evidence.
        positive = factor < -0.2 and declared.q.min() > 0
        yield Equation(
            "reward-sign" if factor < 0 else "reward-scale",
            "",
            f"{factor:.3g}·r + γ·max Q(s′, ·)",
            lambda b: b.right + (factor - 1) * b.reward,
            largest_error=0.25 if positive else 0.12,
            share=0.5 if positive else 0.75,
            slope=factor if 0 < factor < 1 and goes_on else None,
        )
    line = declared.reward_line
    top = line.offset / max(1 - agent.discount, 0.005)  # the value of rewards that stay 0
    fits = line.slope > 0.02 and line.correlation > 0.6
    if goes_on and fits and declared.q.max() > 0.4 * top > 0.5:
        yield Equation(
            "reward-scale",
            "",
            f"{line.slope:.3g}·r + {line.offset:.3g} + γ·max Q(s′, ·)",
            lambda b: b.right + (line.slope - 1) * b.reward + line.offset,
            ADDED_CONSTANT.explanation,
            ADDED_CONSTANT.remedy,
            largest_error=0.15,
            share=0.5,
        )
    for discount in _DISCOUNTS:
        if abs(discount - agent.discount) > 0.25 * (1 - agent.discount):
            yield Equation(
                "other-discount",
                "",
                f"r + {discount:g}·max Q(s′, ·)",
                partial(_discounted, discount),
                largest_error=0.07,
                # After few copies of the target network, values look less far ahead.
                share=0.2 if discount < agent.discount else 0.4,
                discount=discount,
            )
    error = declared.q - declared.right
    # Values that are above their targets everywhere are still falling, from about 0.
    falling = error.mean() > 0.7 * np.sqrt(np.mean(error**2))
    own = agent.task.gravity
    for gravity in () if falling else _GRAVITIES:
        if own is not None and abs(gravity - own) > 0.3 * own:
            task = agent.task.with_gravity(gravity)
            equation = _changed("other-gravity", f"g = {gravity:g}", task=task)
            # After a short training, values are as smooth as at a low gravity. But then the
            # advantages agree no better. Targets of several steps look like a higher one.
            equation = replace(equation, like_short_training=True)
            yield replace(equation, share=0.55) if gravity < own else equation
    # The sign of the correlation is the main evidence.
    yield _changed(
        "torque-map", f"{agent.dynamics.effort}s reversed", share=0.95, efforts=-agent.efforts
    )
    for name in observation_changes(agent.dynamics):
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
