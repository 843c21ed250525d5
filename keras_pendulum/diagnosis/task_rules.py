"""Rules for networks that fit another task, other observations, other torques, or nothing.

Each returns a finding, or None. `findings` says where the thresholds come from.
"""

from __future__ import annotations

import numpy as np

from keras_pendulum.diagnosis import comparisons, repairs
from keras_pendulum.diagnosis.faults import Finding
from keras_pendulum.diagnosis.measurement import Measurement
from keras_pendulum.diagnosis.other_tasks import DISCOUNTS, GRAVITIES
from keras_pendulum.diagnosis.signals import value_fit
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.optimum.dynamics import step_all_torques

_SHIPPED_GRAVITIES = (1.0, 10.0)
_SAME_ACTIONS = 0.8  # correlation of an agent's torques with those that its run stored
_WORST_REWARD = -Pendulum.reward_range[0]


def not_finite(m: Measurement) -> Finding | None:
    """Finds values that are not finite or far beyond every possible one."""
    if not m.finite:
        return Finding("broken-network", "Q-values that are not finite", "all finite")
    largest = float(np.abs(m.learned_q).max())
    limit = _WORST_REWARD / max(1 - m.discount, 0.005)
    if largest > 1e5 * limit:
        if m.learned_q.mean() > m.learned_q.std():
            evidence = f"values of {m.learned_q.mean():.1e}, though no reward is positive"
            return Finding("overestimation", evidence, "at most 0")
        return Finding("broken-network", f"values up to {largest:.1e}", f"at most {limit:.0f}")
    return None


def constant(m: Measurement) -> Finding | None:
    """Finds values that are the same for all states or for all actions."""
    largest = float(np.abs(m.learned_q).max())
    units = max(m.units)
    spread = float(m.learned_q.std(axis=0).max())
    if spread < 1e-6 * max(1.0, largest):
        evidence = f"values that differ by {spread:.1g} from state to state"
        if units > 0.99:
            evidence += f"; {units:.0%} of a layer's units saturated or dead"
        return Finding("broken-network", evidence, f"{m.value_spread:.0f}")
    across = float(np.ptp(m.learned_q, axis=1).max())
    if across < 1e-6 * max(1.0, largest):
        return Finding(
            "broken-network", f"values that differ by {across:.1g} from action to action", "above 1"
        )
    return None


def reward_sign(m: Measurement) -> Finding | None:
    """Finds positive values that fall where the exact ones rise."""
    value = m.value
    # An agent that sees the pendulum upside down has negative values that fall.
    if value.correlation < -0.6 and value.slope < -0.2 and m.learned_q.mean() > 0:
        evidence = f"slope of learned on exact values {value.slope:.2f}"
        return Finding("reward-sign", evidence, "1.00")
    return None


def observation_map(m: Measurement) -> Finding | None:
    """Finds a change of the observation with which the agent acts as its run, or as it should."""
    actions = comparisons.match_actions(m)
    if actions is not None:
        if actions.declared > _SAME_ACTIONS:
            return None
        if actions.by_observation > max(_SAME_ACTIONS, actions.declared + 0.3):
            evidence = "correlation of the torques with those of the run "
            evidence += f"{actions.declared:.2f}, with the observation [{actions.observation}] "
            evidence += f"{actions.by_observation:.2f}"
            repair = repairs.change_observations(m, actions.observation)
            return Finding("observation-map", evidence, "best as it is", repair)
    declared = comparisons.match(m.learned_q, m.exact_q)
    matches = comparisons.match_observations(m)
    name, best = max(matches.items(), key=lambda item: item[1].scaled_score)
    if best.scaled_score < max(0.3, declared.scaled_score + 0.2):
        return None
    repair = repairs.change_observations(m, name)
    if repair.regret > 0.5 * m.regret:
        return None
    evidence = f"match with the exact values {declared.score:.2f}, with the observation "
    evidence += f"[{name}] {best.score:.2f}"
    return Finding("observation-map", evidence, "best as it is", repair)


def torque_map(m: Measurement) -> Finding | None:
    """Finds torques with which the agent acts as its run, or the outputs fit the exact values."""
    actions = comparisons.match_actions(m)
    if actions is not None:
        if actions.declared > _SAME_ACTIONS:
            return None
        if actions.by_torques > max(_SAME_ACTIONS, actions.declared + 0.3):
            return Finding(
                "torque-map",
                f"correlation of the torques with those of the run {actions.declared:.2f}, with "
                f"each output in its place {actions.by_torques:.2f}",
                "the same",
                repairs.change_torques(
                    m, actions.torques, "each output with the torque that the run stored for it"
                ),
            )
    different = np.unique(m.learned_q, axis=1).shape[1]
    if 1 < different < m.learned_q.shape[1] / 2:
        evidence = f"{m.learned_q.shape[1]} outputs with {different} different values"
        return Finding("torque-map", evidence, "all different")
    if m.value.correlation < 0.9 or not 0.5 < m.value.slope < 2:
        return None
    matched = comparisons.matched_correlation(m)
    if matched > 0.4 and matched > m.advantage.correlation + 0.2:
        torques = np.empty_like(m.torques)
        torques[np.argsort(m.output_torques, kind="stable")] = np.sort(m.torques)
        name = "each output with the torque that it behaves like"
        repair = repairs.change_torques(m, torques, name)
        if repair.regret < 0.5 * m.regret:
            return Finding(
                "torque-map",
                f"correlation of the advantages {m.advantage.correlation:.2f}, with each output in "
                f"its place {matched:.2f}",
                "the same",
                repair,
            )
    gain = m.advantage_size / m.value.slope  # noise only makes it larger
    if m.advantage.correlation > 0.4 and gain < 0.42:
        return Finding(
            "torque-map",
            f"outputs that behave like {gain:.2f} times their torques",
            "above 0.55 times",
            repairs.change_torques(m, gain * m.torques, f"torques times {gain:.2g}"),
        )
    return None


def no_lookahead(m: Measurement) -> Finding | None:
    """Compares with the rewards of one step, in which no torque matters yet."""
    if m.record is not None and len(m.record.replay.action) > 0:
        error, declared = comparisons.stored_errors(m, m.record)
        if error < min(0.2, 0.3 * declared):
            evidence = f"values of the stored actions within {error:.0%} of their rewards"
            return Finding("no-bootstrapping", evidence, f"above {declared:.0%}")
    theta, speed = m.states.T
    rewards = value_fit(m.learned_q, step_all_torques(m.task.gravity, theta, speed, m.torques)[0])
    if rewards.correlation < 0.99 or rewards.slope <= 0 or m.advantage_size > 0.45:
        return None
    if m.advantage.correlation > 0.6 or rewards.correlation < m.value.correlation:
        return None
    lookahead = 1 - 1 / rewards.slope  # of a run in which every state follows on itself
    evidence = f"values {rewards.slope:.2f} times the reward of one step (correlation "
    evidence += f"{rewards.correlation:.3f})"
    healthy = f"{1 / (1 - min(m.discount, 0.999)):.0f} and 0.96 on average"
    if abs(lookahead - m.discount) < 0.04 and m.discount > 0.6 and m.advantage.correlation < 0.3:
        return Finding("misaligned-transitions", evidence, "not proportional")
    if 0.8 < rewards.slope < 1.2:
        return Finding("no-bootstrapping", evidence, healthy)
    if 0.1 < lookahead < m.discount - 0.1:
        return Finding("other-discount", f"{evidence}, as for γ = {lookahead:.1f}", healthy)
    return None


def other_task(m: Measurement) -> Finding | None:
    """Finds another gravity or discount that the values fit better."""
    gravity, discount = m.task.gravity, m.discount
    nearest = min(DISCOUNTS, key=lambda each: abs(each - discount))
    tasks = [
        ("other-gravity", f"g = {each:g}", each, nearest)
        for each in GRAVITIES
        # Stored transitions have shown which gravity acted.
        if m.record is None and abs(each - gravity) > 0.3 * gravity
    ] + [
        ("other-discount", f"γ = {each:g}", gravity, each)
        for each in DISCOUNTS
        if gravity in GRAVITIES and abs(each - discount) > 0.25 * (1 - discount)
    ]
    if not tasks:
        return None
    matches = [comparisons.match_task(m, gravity, discount) for _, _, gravity, discount in tasks]
    index = max(range(len(tasks)), key=lambda each: matches[each].scaled_score)
    name, label, gravity, _ = tasks[index]
    best, declared = matches[index], comparisons.match(m.learned_q, m.exact_q).scaled_score
    if best.scaled_score < max(0.55, declared + 0.35 * (1 - declared)):
        return None
    evidence = f"match with the declared task {declared:.2f}, with {label} {best.scaled_score:.2f}"
    repair = None
    # The optimum of another gravity takes 20 s.
    if name == "other-gravity" and gravity in _SHIPPED_GRAVITIES:
        repair = repairs.change_gravity(m, gravity)
    return Finding(name, evidence, "best with the declared task", repair)


def reward_size(m: Measurement) -> Finding | None:
    """Finds values beyond the lowest possible one, or lost in the noise of the weights."""
    lowest = -_WORST_REWARD / max(1 - m.discount, 0.005)
    mean = float(m.learned_q.mean())
    if mean < lowest:
        evidence = f"a mean value of {mean:.3g}"
        return Finding("reward-scale", evidence, f"above {lowest:.0f}, the lowest possible")
    slope = m.value.slope
    if 0 <= slope < 0.02 and m.advantage_size < 0.03 and m.value.correlation > 0.5:
        evidence = f"values {slope:.1g} times the exact ones, and actions as close"
        return Finding("reward-scale", evidence, "1")
    return None


def reward_scale(m: Measurement) -> Finding | None:
    """Finds right values of another size."""
    slope = m.value.slope
    right = m.value.correlation > 0.95 and m.advantage.correlation > 0.5
    if right and slope > 0 and not 0.4 < slope < 2.5:
        return Finding("reward-scale", f"values {slope:.3g} times the exact ones", "0.9 to 1.1")
    return None
