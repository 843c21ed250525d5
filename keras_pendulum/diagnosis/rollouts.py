"""Steps of a policy after one action, and the values that they should have.

Over one step, the sides of a wrong equation may differ little. Over more steps, the difference
grows, and the network's own errors do not.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from keras_pendulum.diagnosis.equation import NextAction
from keras_pendulum.diagnosis.measurement import Measurement
from keras_pendulum.diagnosis.signals import Array

_STATES = 300


class Rollouts(NamedTuple):
    """Steps from N states at which a network's value of a random action is known."""

    q: Array  # [N]: the value of the first action
    rewards: Array  # [T, N]
    values: Array  # [T, N]: that of the next action, after each step

    def rewards_of(self, steps: int, discount: float) -> Array:
        """Returns the discounted rewards [N] of the first steps."""
        factors = discount ** np.arange(steps)
        return np.asarray(factors @ self.rewards[:steps])

    def target(self, discount: float) -> Array:
        """Returns the discounted rewards of all steps, and the value after them, [N]."""
        steps = len(self.rewards)
        return self.rewards_of(steps, discount) + discount**steps * self.values[-1]


def roll_out(m: Measurement, next_action: NextAction, steps: int, repeats: int = 1) -> Rollouts:
    """Returns the steps of a policy after random actions at 300 states.

    Args:
        m: the agent.
        next_action: the policy.
        steps: T.
        repeats: of each state, because a policy may be random; N is 300 · repeats.
    """
    random = np.random.RandomState(4)
    states = m.visited_states
    states = np.repeat(states[random.randint(len(states), size=_STATES)], repeats, axis=0)
    action = np.repeat(random.randint(len(m.efforts), size=_STATES), repeats)
    number = np.arange(len(states))
    q = m.q_values(m.dynamics.observe(states))[number, action]
    rewards, values = np.empty((2, steps, len(states)))
    for step in range(steps):
        outcomes = m.dynamics.outcomes(states, m.efforts[action][:, None])
        rewards[step], states = outcomes.reward[:, 0], outcomes.state[:, 0]
        next_q = m.q_values(m.dynamics.observe(states))
        action = next_action(next_q, random)
        values[step] = next_q[number, action]
    return Rollouts(q, rewards, values)


class FewSteps(NamedTuple):
    """The agreement of values with the rewards of a few steps; a short training has it."""

    steps: int  # that fit best
    error: float  # standard deviation of the difference, as a share of the spread of Q
    rollouts: Rollouts


_LONGEST = 20  # steps


def few_steps(m: Measurement) -> FewSteps:
    """Returns how well the values are the rewards of 1 to 20 steps of the greedy policy."""
    rollouts = roll_out(m, lambda q, random: q.argmax(axis=1), _LONGEST)
    errors = [
        float((rollouts.q - rollouts.rewards_of(count, m.discount)).std()) / m.backup.spread
        for count in range(1, _LONGEST + 1)
    ]
    return FewSteps(int(np.argmin(errors)) + 1, min(errors), rollouts)
