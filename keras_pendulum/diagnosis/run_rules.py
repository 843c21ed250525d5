"""Rules for the steps of a run: its actions, its starts, and its return over time.

Each returns a finding, or None. `findings` says where the thresholds come from.
"""

from __future__ import annotations

import numpy as np

from keras_pendulum.diagnosis.faults import Fault, Finding
from keras_pendulum.diagnosis.measurement import Measurement
from keras_pendulum.diagnosis.played_steps import BEGINNING, PARTS
from keras_pendulum.diagnosis.signals import Array
from keras_pendulum.diagnosis.stored_transitions import OLD_STATE

_LOW = 0.08  # random actions that an ε of 0.1 shows at least
_FALLS = 0.3  # above: the run begins with random actions, also where each lasts for some steps
_LONG_RUN = 4000  # steps: 20 episodes of the pendulum


def old_state(m: Measurement) -> Finding | None:
    """Finds actions that answer the first observation of their episode."""
    if m.record is None or m.record.played is None:
        return None
    played = m.record.played
    episodes = played.episodes()
    if len(episodes) < 20:
        return None
    rows = np.concatenate([np.arange(each.start, each.stop) for each in episodes[-10:]])
    began = np.maximum.accumulate(np.where(played.steps.first[rows], np.arange(len(rows)), 0))
    seen, acted = played.steps.observation[rows], played.effort[rows]
    now, first = (np.mean(np.abs(m.act(each) - acted) < 0.01) for each in (seen, seen[began]))
    if now > 0.6:
        return None
    evidence = f"{now:.0%} of the last actions answer the observation of their step, "
    if first > max(0.7, now + 0.3):
        evidence += f"{first:.0%} the first observation of their episode"
    elif shares := played.constant_episodes(episodes[len(episodes) // 2 :][-40:]):
        evidence += (
            f"two steps of an episode have the same action in {shares[0]:.0%} of the cases, "
        )
        evidence += f"and two steps of two episodes at the same state in {shares[1]:.0%}"
    else:
        return None
    return Finding(
        "misaligned-transitions", evidence, "all of them", variant="same-state", text=OLD_STATE
    )


def exploration(m: Measurement) -> Finding | None:
    """Finds an ε that does not fall, or starts low."""
    r = m.record
    if r is None:
        return None
    if len(r.history) >= 20:
        epsilons = np.array([record.epsilon for record in r.history])
        last, first = epsilons[-len(epsilons) // 5 :].mean(), epsilons[: len(epsilons) // 5].mean()
        if last > 0.5:
            return Finding("exploration", f"ε of the last fifth {last:.2f}", "below 0.1")
        if first < 0.1:
            return Finding("exploration", f"ε of the first fifth {first:.2f}", "above 0.3")
        return None
    if r.played is None or r.steps is None or r.played.action_steps() > 1:
        return None  # steps with the same action do not show which ones were random
    if (shares := r.played.random_shares()) is None:
        return None
    tenths, is_long = shares.tenths, r.steps >= _LONG_RUN
    last = float(tenths[-2:].mean())
    # A program that is stopped early has random actions at its end, too, but not more of them.
    if last > 0.7 and (is_long or last > float(tenths[:2].mean()) + 0.3):
        evidence = f"about {last:.0%} of the actions of the last fifth are random"
        return Finding("exploration", evidence, "below 10 %")
    if shares.lasting > _FALLS or len(r.played.effort) < r.steps:
        return None
    # Many programs learn with a constant ε of 0.1.
    begin, low = "the first tenth of the run", float(tenths[0])
    if is_long and m.task.never_terminates:
        begin, low = "one of the first tenths of the run", float(tenths[:3].min())
    first = f"the first {BEGINNING} steps"
    for part, share, count in (begin, low, r.steps // PARTS), (first, shares.beginning, BEGINNING):
        if share < _LOW - 3 * (_LOW * (1 - _LOW) / count) ** 0.5:  # three standard deviations
            evidence = f"about {share:.0%} of the actions of {part} are random"
            return Finding("exploration", evidence, "above 10 %")
    return None


def narrow_starts(m: Measurement) -> Finding | None:
    """Finds a part of the plane that was never visited."""
    r = m.record
    if r is None or r.steps is None or r.steps >= 3 * len(r.replay.action):
        return None
    if not m.task.never_terminates:  # it starts where its episodes start
        return None
    seen = _seen_cells(m.dynamics.states_of(r.replay.observation))
    evidence = f"stored states in {seen:.0%} of the plane's cells up to 4 rad/s"
    if r.played is not None:
        sectors, episodes = r.played.start_sectors()
        if episodes < 20 or sectors > 4:
            return None
        evidence += f", starts in {sectors} of 8 sectors of θ"
    return Finding("narrow-starts", evidence, "above 90 %") if seen < 0.75 else None


def _seen_cells(states: Array, cells: int = 8) -> float:
    """Returns the share of the cells of the plane, up to 4 rad/s, with one of the states [N, 2]."""
    theta, speed = states[np.abs(states[:, 1]) < 4].T
    edges = [np.linspace(-np.pi, np.pi, cells + 1), np.linspace(-4, 4, cells + 1)]
    counts, *_ = np.histogram2d(theta, speed, bins=edges)
    return float((counts > 0).mean())


def unsteady_return(m: Measurement) -> Finding | None:
    """Finds a run that was clearly better before its end, or jumps until its end."""
    r = m.record
    if r is None:
        return None
    steps = m.task.steps_per_episode
    if r.played is not None:
        means = r.played.curve()
    else:
        means = np.array([getattr(each, m.task.curve_column) for each in r.history])
        means /= m.reward_scale
    if len(means) < 20:
        return None
    random = m.task.curve_value(m.dynamics.random_return(), steps)
    optimum = m.task.curve_value(m.optimum, steps)
    way, what = optimum - random, m.task.curve_label.lower()
    count = max(10, len(means) // 10)
    blocks = np.convolve(means, np.full(count, 1 / count), "valid")
    best, end = int(blocks.argmax()), float(blocks[-1])
    learned = blocks[best] > random + 0.3 * way
    if learned and blocks[best] - end > 0.25 * way:
        return Finding(
            "not-converged",
            f"mean {what} {blocks[best]:.2f} in the episodes {best} to {best + count - 1}, and "
            f"{end:.2f} in the last {count}",
            "highest at the end",
            variant="forgot",
            text=Fault(
                "The run was better before its end. Updates that followed have destroyed what it "
                "had learned.",
                "Keep the best weights. Let the learning rate fall to 0, and make the replay "
                "buffer larger.",
            ),
        )
    last = means[-len(means) // 5 :]
    if last.std() > 0.2 * way:
        return Finding(
            "not-converged",
            f"{what} of the last {len(last)} episodes from {last.min():.2f} to {last.max():.2f}",
            f"near {optimum:.2f}",
            variant="jumps",
            text=Fault(
                "Good and bad episodes alternate until the end of the run. The values still change "
                "by more than the difference between actions.",
                "Train for longer, with a learning rate that falls to 0. Copy the target network "
                "less often.",
            ),
        )
    return None
