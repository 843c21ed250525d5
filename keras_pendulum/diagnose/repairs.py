"""Repairs without training: the agent with one thing changed, played again."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from keras_pendulum.diagnose.comparisons import Change, observation_changes
from keras_pendulum.diagnose.measurement import STARTS, Measurement
from keras_pendulum.diagnose.signals import Array, advantage_fit
from keras_pendulum.diagnose.states import simulate
from keras_pendulum.diagnose.subject import Subject
from keras_pendulum.optimum.optimal_return import optimal_return

_LIKELY_CHANGES = (
    "cos θ, sin θ, -θ̇",
    "sin θ, cos θ, θ̇",
    "-cos θ, sin θ, θ̇",
    "cos θ, sin θ, θ̇·π/180",
)


@dataclass(frozen=True)
class Repair:
    """A change of the agent and the regret that is left with it."""

    name: str
    regret: float


def play(measurement: Measurement, name: str, repaired: Subject) -> Repair:
    """Returns the regret of a repaired agent on the same starts."""
    returns = simulate(repaired.act, repaired.gravity, measurement.starts).returns
    optimum = measurement.optimum
    if repaired.gravity != measurement.subject.gravity:
        optimum = float(optimal_return(repaired.gravity, range(STARTS)).mean())
    return Repair(name, optimum - float(returns.mean()))


def rank_matched_torques(measurement: Measurement) -> Array:
    """Returns the torques [A], given to the outputs in the order in which they behave."""
    torques = measurement.subject.torques
    assert torques is not None
    matched = np.empty_like(torques)
    matched[np.argsort(measurement.output_torques, kind="stable")] = np.sort(torques)
    return matched


def matched_correlation(measurement: Measurement) -> float:
    """Returns the correlation of the advantages with rank-matched outputs.

    The order comes from the even states, the correlation from the odd ones.
    """
    even = replace(measurement)  # a copy without the cached signals
    even.__dict__.update(
        learned_q=measurement.learned_q[::2],
        exact_q=measurement.exact_q[::2],
        value=measurement.value,
    )
    order = np.argsort(even.output_torques, kind="stable")
    torques = measurement.subject.torques
    assert torques is not None
    exact = measurement.exact_q[1::2][:, np.argsort(torques)]
    return advantage_fit(measurement.learned_q[1::2][:, order], exact).correlation


def repair_torques(measurement: Measurement) -> Repair:
    """Plays the agent with the torques that its outputs behave like."""
    repaired = measurement.subject.with_torques(rank_matched_torques(measurement))
    return play(measurement, "each output with the torque that it behaves like", repaired)


def replace_torques(measurement: Measurement, torques: Array) -> Repair:
    """Plays the agent with other torques for its outputs."""
    repaired = measurement.subject.with_torques(torques)
    return play(measurement, "each output with the torque that the run stored for it", repaired)


def rescale_torques(measurement: Measurement, factor: float) -> Repair:
    """Plays the agent with its torques multiplied by a factor."""
    torques = measurement.subject.torques
    assert torques is not None
    repaired = measurement.subject.with_torques(factor * torques)
    return play(measurement, f"torques times {factor:.2g}", repaired)


def mask_outputs(measurement: Measurement, masked: list[int]) -> Repair:
    """Plays the agent without some outputs."""
    used = np.ones(measurement.learned_q.shape[1], bool)
    used[masked] = False
    names = ", ".join(map(str, masked))
    return play(measurement, f"without the outputs {names}", measurement.subject.with_outputs(used))


def change_observations(measurement: Measurement, name: str) -> Repair:
    """Plays the agent with a changed observation, one of `observation_changes`."""
    change = observation_changes()[name]
    return play(measurement, f"observation [{name}]", measurement.subject.with_observations(change))


def change_gravity(measurement: Measurement, gravity: float) -> Repair:
    """Plays the agent at another gravity; the regret is that of the other task."""
    return play(measurement, f"g = {gravity:g}", replace(measurement.subject, gravity=gravity))


def repair_bare_policy(measurement: Measurement) -> list[tuple[str, Repair]]:
    """Plays a policy without Q-values with each simple change; returns finding and repair."""
    subject = measurement.subject
    act = subject.act
    negative = replace(subject, act=lambda observations: -np.asarray(act(observations)))
    repairs = [("torque-map", play(measurement, "torque reversed", negative))]
    for name in _LIKELY_CHANGES:
        change: Change = observation_changes()[name]
        repaired = subject.with_observations(change)
        repairs.append(("observation-map", play(measurement, f"observation [{name}]", repaired)))
    return repairs
