"""The states at which a diagnosis compares Q-values, and the episodes that it simulates."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import permutations, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.diagnosis.signals import Array
from keras_pendulum.optimum.known_dynamics import KnownDynamics

# From observations [B, D] to efforts [B] in N·m or N.
Act = Callable[[NDArray[np.float32]], Array]

_NEAR_AN_END = 10  # steps


class Episodes(NamedTuple):
    """Simulated episodes from B starts."""

    states: Array  # [steps, B, S]
    rewards: Array  # [steps, B], 0 after the end
    playing: NDArray[np.bool_]  # [steps, B], false after the end

    @property
    def returns(self) -> Array:
        """The undiscounted returns [B]."""
        return np.asarray(self.rewards.sum(axis=0))

    def returns_to_go(self, discount: float) -> Array:
        """Returns the discounted sums of the rewards from each step on, [steps, B]."""
        sums = self.rewards.copy()
        for step in range(len(sums) - 2, -1, -1):
            sums[step] += discount * sums[step + 1]
        return sums


def simulate(act: Act, exact: KnownDynamics, starts: Array) -> Episodes:
    """Returns the episodes of a policy; an effort that is no finite number counts as 0.

    Args:
        act: the policy.
        exact: the task.
        starts: [B, S].
    """
    steps, limit = exact.task.steps_per_episode, exact.largest_effort
    states = np.empty((steps, *starts.shape))
    rewards, playing = np.zeros(states.shape[:2]), np.zeros(states.shape[:2], bool)
    state, on = starts, np.ones(len(starts), bool)
    for step in range(steps):
        states[step], playing[step] = state, on
        if not on.any():
            continue
        effort = np.asarray(act(exact.observe(state)), np.float64)
        effort = np.where(np.isfinite(effort), effort, 0).clip(-limit, limit)
        outcomes = exact.outcomes(state, effort[:, None])
        rewards[step, on] = outcomes.reward[on, 0]
        state = np.where(on[:, None], outcomes.state[:, 0], state)
        on = on & ~outcomes.terminated[:, 0]
    return Episodes(states, rewards, playing)


def explored_states(
    greedy: Act, efforts: Array, exact: KnownDynamics, starts: Array, seed: int, count: int
) -> Array:
    """Returns `count` states [N, S] that a policy meets with a share of random actions.

    The share of an episode is from `least_random` to 1. Where episodes terminate, more of them are
    played, only their first 100 steps are used, and half of the states are near an end.

    Args:
        greedy: the policy.
        efforts: those among which a random action is drawn, [A].
        exact: the task.
        starts: [B, S].
        seed: of the random actions.
        count: N.
    """
    random = np.random.RandomState(seed)
    if not exact.task.never_terminates:
        starts = np.tile(starts, (-(-count // (8 * len(starts))), 1))
    epsilon = np.linspace(exact.least_random, 1, len(starts))
    epsilon = epsilon[random.permutation(len(starts))]

    def act(observations: NDArray[np.float32]) -> Array:
        explore = random.random_sample(len(epsilon)) < epsilon
        index = random.randint(len(efforts), size=len(epsilon))
        return np.asarray(np.where(explore, efforts[index], greedy(observations)))

    episodes = simulate(act, exact, starts)
    if exact.task.never_terminates:
        return _some(episodes.states[episodes.playing], count, random)
    playing = episodes.playing & (np.arange(len(episodes.playing)) < 100)[:, None]
    later = np.roll(episodes.playing, -_NEAR_AN_END, axis=0)
    later[-_NEAR_AN_END:] = True  # the limit of the steps is not an end
    near = _some(episodes.states[playing & ~later], count // 2, random)
    return np.concatenate([near, _some(episodes.states[playing], count - len(near), random)])


def _some(states: Array, count: int, random: np.random.RandomState) -> Array:
    return states[random.permutation(len(states))[:count]]


def observation_changes(exact: KnownDynamics) -> dict[str, NDArray[np.float32]]:
    """Returns matrices [D, D] that undo a wrong order, sign or unit of the observation, by name."""
    return _changes(exact.task.observation_names, type(exact))


@cache
def _changes(names: tuple[str, ...], kind: type[KnownDynamics]) -> dict[str, NDArray[np.float32]]:
    identity = np.eye(len(names), dtype=np.float32)
    changes = {}
    for order in permutations(range(len(names))):
        for signs in product((1, -1), repeat=len(names)):
            if len(names) > 3 and min(signs) < 0 and list(order) != sorted(order):
                continue  # there are hundreds of such pairs, and programs hardly have them
            name = ", ".join(
                ("-" if sign < 0 else "") + names[i] for i, sign in zip(order, signs, strict=True)
            )
            changes[name] = identity[:, list(order)] * np.array(signs, np.float32)
    # A mirrored observation is a reversed effort, because the task is symmetric.
    for same in (identity, np.diag(np.array(kind.mirror, np.float32))):
        changes = {name: each for name, each in changes.items() if not np.array_equal(each, same)}
    for units, factors in kind.other_units.items():
        changes[units] = np.diag(np.array(factors, np.float32))
    return changes
