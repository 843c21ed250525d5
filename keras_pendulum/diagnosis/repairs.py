"""Repairs without training: the agent with one thing changed, played again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from keras_pendulum.diagnosis.faults import Finding, Repair
from keras_pendulum.diagnosis.measurement import Measurement
from keras_pendulum.diagnosis.played_agent import STARTS, PlayedAgent
from keras_pendulum.diagnosis.signals import Array
from keras_pendulum.diagnosis.states import Act, observation_changes

# Of a slow policy, only these of `observation_changes` are tried.
_LIKELY_CHANGES = (
    "cos θ, sin θ, -θ̇",
    "sin θ, cos θ, θ̇",
    "-cos θ, sin θ, θ̇",
    "cos θ, sin θ, θ̇·π/180",
    "θ, θ̇, x, ẋ",
    "x, θ, ẋ, θ̇",
    "x, ẋ, θ·180/π, θ̇·180/π",
)

# With one of these, a half-trained policy may stay near the middle of the track.
_BY_CHANCE = ("-x, ẋ, θ, θ̇", "x, -ẋ, θ, θ̇", "-x, -ẋ, θ, θ̇")

_FACTORS = {"half the torque": 0.5, "double the torque": 2.0}
_FEW_STARTS = 4  # to choose the changes that are played on all


def change_efforts(m: Measurement, efforts: Array, name: str) -> Repair:
    """Plays the agent with other efforts [A] for its outputs."""
    return _play(m, name, lambda observations: efforts[m.q_values(observations).argmax(axis=1)])


def mask_outputs(m: Measurement, masked: list[int]) -> Repair:
    """Plays the agent without some outputs."""
    used = ~np.isin(np.arange(len(m.efforts)), masked)
    return _play(
        m,
        f"without the outputs {', '.join(map(str, masked))}",
        lambda observations: m.efforts[
            np.where(used, m.q_values(observations), -np.inf).argmax(axis=1)
        ],
    )


def change_observations(m: PlayedAgent, name: str) -> Repair:
    """Plays the agent with a changed observation, one of `observation_changes`."""
    change = observation_changes(m.dynamics)[name]
    return _play(m, f"observation [{name}]", lambda observations: m.act(observations @ change))


def _scale_efforts(m: PlayedAgent, name: str, factor: float) -> Repair:
    return _play(m, name, lambda observations: factor * m.act(observations))


def find_by_repairs(m: PlayedAgent) -> list[Finding]:
    """Returns the finding on a policy without Q-values: the simple change that helps most.

    Where the policy is fast, each change is tried on a few starts, also each order and sign of the
    observation, and the best of each kind is played on all.
    """
    factors = {f"{m.dynamics.effort} reversed": -1.0} | (_FACTORS if m.dynamics.any_effort else {})
    if np.abs(m.first_efforts).max() > 0.5 * m.dynamics.largest_effort:
        factors.pop("double the torque", None)  # a half-trained policy plays better with it, too
    changes = [name for name in observation_changes(m.dynamics) if name not in _BY_CHANCE]
    scaled, changed = list(factors), [name for name in _LIKELY_CHANGES if name in changes]
    if m.start_count == STARTS:
        few = replace(m, start_count=_FEW_STARTS)
        scaled = [min(scaled, key=lambda name: _scale_efforts(few, name, factors[name]).regret)]
        changed = [min(changes, key=lambda name: change_observations(few, name).regret)]
    repairs = [("torque-map", _scale_efforts(m, name, factors[name])) for name in scaled]
    repairs += [("observation-map", change_observations(m, name)) for name in changed]
    name, best = min(repairs, key=lambda item: item[1].regret)
    if best.won <= 0.5 * m.avoidable_regret:
        return []
    evidence = f"with {best.name} the regret is {best.regret:.1f}"
    return [Finding(name, evidence, "no change helps", best)]


def _play(m: PlayedAgent, name: str, act: Act) -> Repair:
    regret = m.optimum - float(m.play(act).returns.mean())
    return Repair(name, regret, m.regret - regret)
