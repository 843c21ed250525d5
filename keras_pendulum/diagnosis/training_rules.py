"""Rules for faults of the training, from the network and from the run's record.

Each returns a finding, or None. `findings` says where the thresholds come from.
"""

from __future__ import annotations

import numpy as np

from keras_pendulum.diagnosis import repairs
from keras_pendulum.diagnosis.faults import Finding
from keras_pendulum.diagnosis.lasting_rules import clearly_last
from keras_pendulum.diagnosis.measurement import Measurement

# Outputs that were not learned are so far above the others, in spreads of their values and of the
# exact ones. Initial values differ less.
_AHEAD, _LEARNED = 0.25, 0.02
_STORED = 0.25  # times the usual number; an output with so many transitions has been learned


def untrained_outputs(m: Measurement) -> Finding | None:
    """Finds outputs that are stored as others, never stored, or far from all others."""
    lost = [] if m.record is None else m.motion.lost_actions()
    if lost:
        return Finding(
            "untrained-outputs",
            f"the outputs {', '.join(map(str, lost))} acted, but were stored as others",
            "each stored as itself",
            repairs.mask_outputs(m, lost),
        )
    if m.record is not None:
        counts = np.bincount(m.record.replay.action, minlength=len(m.efforts))
        missing = np.flatnonzero(counts == 0).tolist()
        # An output that is drawn at random λ times on average is missed with probability exp(-λ).
        chance = m.record.random_count / len(counts) - np.log(len(counts))
        if len(missing) < len(counts) / 2 and len(missing) * chance > 9:
            return Finding(
                "untrained-outputs",
                f"no stored transition of the outputs {', '.join(map(str, missing))}",
                "about the same number of each",
                repairs.mask_outputs(m, missing),
            )
    odd = np.flatnonzero(m.outliers > max(10.0, 0.3 * m.outliers.max())).tolist()
    others = np.delete(m.learned_q, odd, axis=1)
    ahead = max(_AHEAD * others.std(), _LEARNED * m.value_spread)
    picked = bool(odd) and m.learned_q[:, odd].mean() > others.mean() + ahead
    if m.record is not None and m.record.is_buffer and picked:
        picked = bool(counts[odd].min() < _STORED * counts.mean())
    if picked and len(odd) <= len(m.outliers) / 4 and m.outliers.max() > 14:
        return Finding(
            "untrained-outputs",
            f"mean error of the outputs {', '.join(map(str, odd))} {m.outliers.max():.0f} times "
            "the usual distance from the others",
            "up to 7 times",
            repairs.mask_outputs(m, odd),
        )
    return None


def stored_rewards(m: Measurement) -> Finding | None:
    """Finds values of the stored actions that are their rewards, not their targets."""
    if m.record is None or len(m.record.replay.action) == 0:
        return None
    replay = m.record.replay
    reward = replay.reward / m.reward_scale
    learned = m.q_values(replay.observation)[np.arange(len(reward)), replay.action]
    target = reward + m.discount * m.q_values(replay.next_observation).max(axis=1)
    spread = max(float(reward.std()), 1e-9)
    error, declared = (
        float(np.sqrt(np.mean((learned - truth) ** 2))) / spread for truth in (reward, target)
    )
    if error >= min(0.2, 0.3 * declared):
        return None
    evidence = f"values of the stored actions within {error:.0%} of their rewards"
    return Finding("no-bootstrapping", evidence, f"above {declared:.0%}")


def too_few_updates(m: Measurement) -> Finding | None:
    """Finds values that have hardly left their initial size."""
    updates = m.updates
    if updates is None or updates > 4000:
        return None
    if not -0.2 < m.value.slope < 0.75 or m.advantage.correlation > 0.3:
        return None
    evidence = f"slope of learned on exact values {m.value.slope:.2f}, after {updates} updates"
    return Finding("too-few-updates", evidence, "1.00, after some 10 000 updates")


def learning_rate(m: Measurement) -> Finding | None:
    """Finds a large recorded learning rate."""
    if m.record is None or m.record.config is None:
        return None
    rate, schedule = m.record.config.learning_rate, m.record.config.learning_rate_schedule
    if rate < 5e-3 and (schedule != "constant" or rate < 2e-3):
        return None
    saturated, dead = m.stuck_units
    evidence = f"learning rate {rate:g}, {schedule}; {saturated:.0%} of a layer's tanh "
    evidence += f"units saturated, {dead:.0%} of the ReLU units dead"
    return Finding("learning-rate", evidence, "1e-3, falling to 0")


def saturated_layer(m: Measurement) -> Finding | None:
    """Finds the saturated layer that a large learning rate leaves."""
    saturated, dead = m.stuck_units
    if m.record is None and (saturated > 0.93 or dead > 0.8) and m.value.correlation > 0.8:
        evidence = f"{max(saturated, dead):.0%} of a layer's units saturated or dead"
        return Finding("learning-rate", evidence, "below 85 %")
    return None


def overestimation(m: Measurement) -> Finding | None:
    """Finds values above the best possible ones, and above what the policy collects."""
    excess = m.excess
    # Also where nothing else about the values is right. A step that lasts has more reward.
    if excess > 3 and not clearly_last(m):
        evidence = f"the highest value is above the best possible by {excess:.1f} spreads"
        return Finding("overestimation", evidence, "0.00 to 0.15")
    # A policy collects less than its values promise for many reasons. This setting is one of them.
    if m.settings.get("target_update") != "none":
        return None
    right = m.value.correlation > 0.9 and m.value.slope > 0.5
    if right and m.value_overestimate > 0.2:
        evidence = "the highest value of the visited states is above what the policy collects by "
        evidence += f"{m.value_overestimate:.2f} spreads, above the best possible by {excess:.2f}"
        evidence += ", after a run without a target network"
        return Finding("overestimation", evidence, "up to 0.30, both")
    return None
