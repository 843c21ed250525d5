"""Rules for the transitions that a run stored.

Each returns a finding, or None. `findings` says where the thresholds come from.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.diagnosis import repairs
from keras_pendulum.diagnosis.faults import ADDED_CONSTANT, FAULTS, Fault, Finding
from keras_pendulum.diagnosis.measurement import Measurement
from keras_pendulum.diagnosis.motion import FEW
from keras_pendulum.diagnosis.run_record import RunRecord
from keras_pendulum.diagnosis.signals import Array
from keras_pendulum.diagnosis.stored_transitions import (
    StoredRewards,
    constant_number,
    has_several_steps,
    repeated_state,
)

_BATCH_SIZES = (32, 50, 64, 100, 128, 200, 256)  # so many transitions may be a batch
_SMALL_BUFFER = 6000
_OTHER_EFFORT = 0.05  # N·m or N
_BEYOND = 1.1  # times the observation; what is then no end is not near one


def stored_transitions(m: Measurement) -> Finding | None:
    """Checks the stored transitions against the dynamics: a mismatch is a proof."""
    r = m.record
    if r is None or len(r.replay.action) < FEW:
        return None
    rewards = StoredRewards(m, r)
    if rewards.fit.correlation < -0.9:
        return Finding("reward-sign", "stored rewards are the negative of the exact ones", "equal")
    finding = constant_number(m, r) or _many_ends(m, r) or repeated_state(r)
    if finding is None and m.motion.obeying() < 0.98:
        one_step = rewards.fit.correlation > 0.999 and abs(rewards.fit.slope - 1) < 0.01
        if (has_several_steps(r) and not one_step) or m.motion.action_lasts():
            return None  # right, but not to be compared with one step of the dynamics
        finding = _other_actions(m, r) or _other_efforts(m, r) or _other_motion(m)
    return finding or _missing_ends(m, r) or _other_rewards(m, r, rewards)


def _many_ends(m: Measurement, r: RunRecord) -> Finding | None:
    """Finds many ends where the task goes on."""
    terminal = (r.replay.terminated & ~_ended(m, r)).mean()
    if terminal > 0.2:
        evidence = f"{terminal:.0%} of the stored transitions are ends, and the task goes on there"
        if terminal > 0.95:
            evidence += " (if the program stores 1 - done, hand in 1 minus it)"
        return Finding("no-bootstrapping", evidence, "none")
    return None


def _missing_ends(m: Measurement, r: RunRecord) -> Finding | None:
    """Finds ends that are not stored."""
    ended = _ended(m, r)
    missing = np.mean(~r.replay.terminated[ended]) if ended.sum() > 10 else 0.0
    if missing > 0.5:
        evidence = f"{missing:.0%} of the transitions that end an episode are not stored as ends"
        return Finding("missing-end", evidence, "none")
    return None


def _ended(m: Measurement, r: RunRecord) -> NDArray[np.bool_]:
    """Returns which transitions [N] terminate their episode by the rules of the task."""
    return m.dynamics.are_over(m.dynamics.states_of(r.replay.next_observation))


def _other_motion(m: Measurement) -> Finding | None:
    """Finds transitions of another pendulum, or of several steps."""
    gravity, correlation = m.motion.fit()
    if correlation < 0.9 and not m.motion.lost_actions():
        return Finding(
            "misaligned-transitions",
            f"correlation of the stored action with the {m.dynamics.effort} that acted "
            f"{correlation:.2f}",
            "1.00",
        )
    own = m.task.gravity
    if gravity is not None and own is not None and abs(gravity - own) > 0.3 * own:
        evidence = f"stored transitions of a pendulum with g = {gravity:.2f}"
        return Finding("other-gravity", evidence, f"{own:.2f}")
    return None


def _other_actions(m: Measurement, r: RunRecord) -> Finding | None:
    """Finds stored actions that are not those that acted, and are not lost ones."""
    motion = m.motion
    found = motion.acted_actions()
    if found is None or motion.lost_actions():
        return None
    rows, acted = found
    stored = motion.replay.action[rows]
    wrong = stored != acted
    if wrong.mean() < 0.02 or motion.index_efforts() is not None:
        return None
    part = f"in {wrong.mean():.0%} of the stored transitions, another {m.dynamics.effort} acted "
    part += "than the stored "
    if m.policy.has_q_values:
        rows, acted, stored = rows[wrong][-500:], acted[wrong][-500:], stored[wrong][-500:]
        greedy = m.q_values(motion.replay.observation[rows]).argmax(axis=1)
        stored_greedy, acted_greedy = np.mean(greedy == stored), np.mean(greedy == acted)
        if stored_greedy > acted_greedy + 0.25:
            evidence = f"{part}one; {stored_greedy:.0%} of those stored are the agent's greedy ones"
            return Finding(
                "misaligned-transitions",
                evidence,
                "none",
                variant="greedy-stored",
                text=Fault(
                    "The greedy action is stored where a random one acted. So its value is learned "
                    "from the result of another action.",
                    "Store the action that was given to the environment.",
                ),
            )
    return Finding("misaligned-transitions", f"{part}one", "none") if wrong.mean() > 0.1 else None


def _other_efforts(m: Measurement, r: RunRecord) -> Finding | None:
    """Finds indices that acted with other efforts than the declared ones."""
    if r.own_efforts is not None or m.motion.lost_actions():
        return None
    efforts = m.efforts
    name = f"each output with the {m.dynamics.effort} that acted where it was stored"
    if r.effort is not None and r.is_buffer is False:  # the torques that the program chose
        used = np.unique(r.effort[-len(r.effort) // 5 :])
        far = np.abs(used[:, None] - efforts).min(axis=1) > _OTHER_EFFORT
        if len(used) == len(efforts) and far.mean() > 0.3:
            found = np.sort(used)[np.argsort(np.argsort(efforts))]
            return _torque_map(m, found, "recorded", name)
    acted = m.motion.index_efforts()
    if acted is None or np.abs(acted - efforts).max() <= _OTHER_EFFORT:
        return None
    limit = m.dynamics.largest_effort
    return _torque_map(m, acted.clip(-limit, limit), "stored", name)


def _torque_map(m: Measurement, found: Array, kind: str, name: str) -> Finding:
    worst = int(np.abs(found - m.efforts).argmax())
    unit = m.dynamics.unit
    evidence = f"where the index {worst} was {kind}, {found[worst]:.2f} {unit} acted"
    repair = repairs.change_efforts(m, found, name) if m.policy.has_q_values else None
    healthy = f"{m.efforts[worst]:.2f} {unit}"
    return Finding("torque-map", evidence, healthy, repair, proven=True)


def _other_rewards(m: Measurement, r: RunRecord, rewards: StoredRewards) -> Finding | None:
    slope, constant, correlation = rewards.fit
    if correlation > 0.999:
        # A recorder sees the rewards before the program scales them.
        declared = r.is_buffer or not 0.5 < slope * m.reward_scale < 2
        if not 0.5 < slope < 2 and declared:
            evidence = f"stored rewards {slope:.3g} times the declared ones"
            if m.task.never_terminates and abs(constant) > 0.01 * abs(slope):
                evidence += f" plus {constant:.3g}"
                return Finding("reward-scale", evidence, "1 and 0", text=ADDED_CONSTANT)
            return Finding("reward-scale", evidence, "1")
        if correlation > 0.9999:
            return None
    residual = float(np.sqrt(max(0.0, 1 - correlation**2)))
    if residual > 0.02 and rewards.shifted_correlation > 0.9999:
        evidence = "stored rewards are those of the step before"
        return Finding("misaligned-transitions", evidence, "those of their own step")
    if correlation < 0.995 and rewards.follow_states:
        kind = "stored" if r.is_buffer else "recorded"
        evidence = f"correlation of the {kind} rewards with the exact ones {correlation:.2f}"
        return Finding("other-reward", evidence, "1.00")
    return None


def forgetting(m: Measurement) -> Finding | None:
    """Finds a replay buffer that holds a small part of the run, or no replay at all."""
    r = m.record
    if r is None or not r.is_buffer:
        return None
    # An episode of CartPole is short until the pole is balanced.
    small = _SMALL_BUFFER if m.task.never_terminates else 1000
    stored = len(r.replay.action)
    if stored in _BATCH_SIZES and r.steps is None and r.follows.mean() > 0.9:
        return Finding(
            "forgetting",
            f"{r.follows.mean():.0%} of the {stored} transitions follow each other",
            "nearly none of a batch, and a buffer of 14 000 or more",
            variant="no-replay",
            text=Fault(
                "The network learns from the last steps in their order. They are all alike, so it "
                "forgets the rest of the plane.",
                "Store the transitions in a replay buffer of at least 14 000, and draw each batch "
                "at random.",
            ),
        )
    if r.steps is not None and r.steps >= 3 * stored and stored < small:
        evidence = f"the buffer holds {stored} of {r.steps} transitions"
        return Finding("forgetting", evidence, "14 000 or more, as `reference` has")
    return None


def truncation_as_end(m: Measurement) -> Finding | None:
    """Finds stored ends where the task goes on."""
    if m.record is None:
        return None
    following = m.record.replay.next_observation
    near = m.dynamics.are_over(m.dynamics.states_of(_BEYOND * following))  # units may be inexact
    share = (m.record.replay.terminated & ~near).mean()
    if not share:
        return None
    evidence = f"{share:.1%} of the stored transitions are ends, and the task goes on there"
    if m.task.never_terminates:
        text = FAULTS["truncation-as-end"]
        return Finding("no-bootstrapping", evidence, "none", variant="truncation", text=text)
    return Finding("truncation-as-end", evidence, "none")
