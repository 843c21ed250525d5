"""Rules for agents that act in another way than they have learned.

Each returns a finding, or None. `findings` says where the thresholds come from.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from keras_pendulum.diagnosis import repairs
from keras_pendulum.diagnosis.faults import Fault, Finding
from keras_pendulum.diagnosis.measurement import Measurement
from keras_pendulum.diagnosis.signals import Array, advantage_fit, line_fit, output_efforts
from keras_pendulum.diagnosis.states import observation_changes

SAME_ACTIONS = 0.8  # correlation of an agent's efforts with those that its run stored
_SMALL = 0.75  # of the largest torque that the pendulum takes


def observation_map(m: Measurement) -> Finding | None:
    """Finds a change of the observation with which the agent acts as its run."""
    actions = match_actions(m)
    if actions is None or actions.declared > SAME_ACTIONS:
        return None
    if actions.by_observation > max(SAME_ACTIONS, actions.declared + 0.3):
        evidence = f"correlation of the {m.dynamics.effort}s with those of the run "
        evidence += f"{actions.declared:.2f}, with the observation [{actions.observation}] "
        evidence += f"{actions.by_observation:.2f}"
        repair = repairs.change_observations(m, actions.observation)
        return Finding("observation-map", evidence, "best as it is", repair, proven=True)
    return None


def torque_map(m: Measurement) -> Finding | None:
    """Finds torques with which the agent acts as its run, or the outputs fit the exact values."""
    actions = match_actions(m)
    if actions is not None:
        if actions.declared > SAME_ACTIONS:
            return None
        if actions.by_efforts > max(SAME_ACTIONS, actions.declared + 0.3):
            return Finding(
                "torque-map",
                f"correlation of the {m.dynamics.effort}s with those of the run "
                f"{actions.declared:.2f}, with each output in its place {actions.by_efforts:.2f}",
                "the same",
                repairs.change_efforts(
                    m,
                    actions.efforts,
                    f"each output with the {m.dynamics.effort} that the run stored for it",
                ),
                proven=True,
            )
    different = np.unique(m.learned_q, axis=1).shape[1]
    if 1 < different < m.learned_q.shape[1] / 2:
        evidence = f"{m.learned_q.shape[1]} outputs with {different} different values"
        return Finding("torque-map", evidence, "all different")
    if m.value.correlation < 0.9 or not 0.5 < m.value.slope < 2 or not m.dynamics.any_effort:
        return None
    matched = _matched_correlation(m)
    if matched > 0.4 and matched > m.advantage.correlation + 0.2:
        torques = np.empty_like(m.efforts)
        torques[np.argsort(m.output_efforts, kind="stable")] = np.sort(m.efforts)
        name = "each output with the torque that it behaves like"
        return Finding(
            "torque-map",
            f"correlation of the advantages {m.advantage.correlation:.2f}, with each output in "
            f"its place {matched:.2f}",
            "the same",
            repairs.change_efforts(m, torques, name),
        )
    gain = m.advantage_size / m.value.slope  # noise only makes it larger
    if m.advantage.correlation > 0.4 and gain < 0.42:
        return Finding(
            "torque-map",
            f"outputs that behave like {gain:.2f} times their torques",
            "above 0.55 times",
            repairs.change_efforts(m, gain * m.efforts, f"torques times {gain:.2g}"),
        )
    return None


def _matched_correlation(m: Measurement) -> float:
    """Returns the correlation of the advantages with rank-matched outputs.

    The order comes from the even states, the correlation from the odd ones.
    """
    found = output_efforts(m.learned_q[::2], m.exact_q[::2], m.efforts)
    order = np.argsort(found, kind="stable")
    exact = m.exact_q[1::2][:, np.argsort(m.efforts)]
    return advantage_fit(m.learned_q[1::2][:, order], exact).correlation


def small_torques(m: Measurement) -> Finding | None:
    """Finds torques that are all small, where the agent plays better with larger ones."""
    largest, limit = np.abs(m.efforts).max(), m.dynamics.largest_effort
    if not m.dynamics.any_effort or not 0 < largest < _SMALL * limit or not m.finite:
        return None
    factor = limit / largest
    text = Fault(
        f"The outputs stand for at most {largest:.2g} N·m, and the pendulum takes {limit:g}. With "
        "larger torques the same values play better. Either the training had them, or the program "
        "does not use all that is possible.",
        f"Name the torques of the training with torques= (--torques), or multiply by {factor:.2g} "
        "where the agent acts.",
    )
    repair = repairs.change_efforts(m, factor * m.efforts, f"torques times {factor:.2g}")
    return Finding(
        "torque-map",
        f"with {repair.name} the regret is {repair.regret:.1f}",
        "no change helps",
        repair,
        text=text,
    )


class ActionMatch(NamedTuple):
    """The correlation of the efforts that an agent chooses with those that its run stored."""

    declared: float  # of the agent as it is
    efforts: Array  # [A]: the effort that the run stored most often where an output is chosen
    by_efforts: float  # with these efforts, on transitions that did not choose them
    observation: str  # the change of the observation that matches best
    by_observation: float  # with this change


def match_actions(m: Measurement) -> ActionMatch | None:
    """Returns the match with the last 1000 stored actions, which a run chooses greedily.

    Returns None without 200 of them.
    """
    if m.record is None or len(m.record.replay.action) < 200:
        return None
    observations, efforts = m.record.replay.observation[-1000:], m.efforts
    stored = m.record.replay.action[-1000:]

    def match_stored(acted: Array) -> float:
        return line_fit(acted, efforts[stored]).correlation

    chosen = m.q_values(observations).argmax(axis=1)
    counts = np.zeros((len(efforts), len(efforts)), np.intp)
    np.add.at(counts, (chosen[::2], stored[::2]), 1)
    found = np.where(counts.any(axis=1), efforts[counts.argmax(axis=1)], efforts)
    by_change = {
        name: match_stored(m.act(observations @ change))
        for name, change in observation_changes(m.dynamics).items()
    }
    best = max(by_change, key=lambda name: by_change[name])
    return ActionMatch(
        match_stored(m.act(observations)),
        found,
        line_fit(found[chosen[1::2]], efforts[stored[1::2]]).correlation,
        best,
        by_change[best],
    )
