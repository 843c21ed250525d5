"""Repairs without training: the agent with one thing changed, played again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from keras_pendulum.diagnosis.comparisons import OBSERVATION_CHANGES
from keras_pendulum.diagnosis.faults import Finding, Repair
from keras_pendulum.diagnosis.measurement import Measurement
from keras_pendulum.diagnosis.signals import Array
from keras_pendulum.diagnosis.states import Act, simulate
from keras_pendulum.environments.pendulum import Pendulum

_LIKELY_CHANGES = (
    "cos θ, sin θ, -θ̇",
    "sin θ, cos θ, θ̇",
    "-cos θ, sin θ, θ̇",
    "cos θ, sin θ, θ̇·π/180",
)


def change_torques(m: Measurement, torques: Array, name: str) -> Repair:
    """Plays the agent with other torques [A] for its outputs."""
    return _play(m, name, lambda observations: torques[m.q_values(observations).argmax(axis=1)])


def mask_outputs(m: Measurement, masked: list[int]) -> Repair:
    """Plays the agent without some outputs."""
    used = ~np.isin(np.arange(len(m.torques)), masked)
    return _play(
        m,
        f"without the outputs {', '.join(map(str, masked))}",
        lambda observations: m.torques[
            np.where(used, m.q_values(observations), -np.inf).argmax(axis=1)
        ],
    )


def change_observations(m: Measurement, name: str) -> Repair:
    """Plays the agent with a changed observation, one of `OBSERVATION_CHANGES`."""
    change = OBSERVATION_CHANGES[name]
    return _play(m, f"observation [{name}]", lambda observations: m.act(observations @ change))


def change_gravity(m: Measurement, gravity: float) -> Repair:
    """Plays the agent at another gravity; the regret is that of the other task."""
    regret = replace(m, task=Pendulum(gravity)).regret
    return Repair(f"g = {gravity:g}", regret, m.regret - regret)


def find_by_repairs(m: Measurement) -> list[Finding]:
    """Returns the finding on a policy without Q-values: the simple change that helps most."""
    reverse = _play(m, "torque reversed", lambda observations: -m.act(observations))
    repairs = [("torque-map", reverse)]
    repairs += [("observation-map", change_observations(m, name)) for name in _LIKELY_CHANGES]
    name, best = min(repairs, key=lambda item: item[1].regret)
    if best.won <= 0.5 * m.regret:
        return []
    evidence = f"with {best.name} the regret is {best.regret:.1f}"
    return [Finding(name, evidence, "no change helps", best)]


def _play(m: Measurement, name: str, act: Act) -> Repair:
    regret = m.optimum - float(simulate(act, m.task.gravity, m.starts).returns.mean())
    return Repair(name, regret, m.regret - regret)
