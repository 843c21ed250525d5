"""Five environments for a DQN that does not learn: in each, the right Q-values are known.

    python examples/probes.py

trains the DQN of my_dqn.py in each of them and compares its values with the right ones, which takes
seconds. Change my_dqn.py and run it again, or test a DQN of your own: `import probes`, train it in
`gymnasium.make("OneState-v0")` (or another name of `PROBES`), and call
`probes.check(q_function, "OneState-v0", discount)`. Stop at the first probe that fails:
docs/my_dqn_does_not_learn.md says what is wrong. Each observation is one number, and each episode
ends after one step or two.
"""

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Discrete

DISCOUNT = 0.9  # γ of the trainings here


class OneState(gymnasium.Env):
    """One state, one action, one step. The reward is 1, and so is the value."""

    observation_space, action_space = Box(-1, 1, (1,)), Discrete(1)

    def reset(self, *, seed=None, options=None):
        """Begins an episode."""
        super().reset(seed=seed)
        return np.array([1], np.float32), {}

    def step(self, action):
        """Ends the episode."""
        return np.array([1], np.float32), 1.0, True, False, {}

    @staticmethod
    def right_values(discount):
        """Returns all observations [N, 1] and their Q-values [N, A]."""
        return [[1]], [[1]]


class ByObservation(gymnasium.Env):
    """The observation is -1 or 1, one action, one step. The reward is the observation."""

    observation_space, action_space = Box(-1, 1, (1,)), Discrete(1)

    def reset(self, *, seed=None, options=None):
        """Begins an episode."""
        super().reset(seed=seed)
        self.state = self.np_random.choice([-1, 1])
        return np.array([self.state], np.float32), {}

    def step(self, action):
        """Ends the episode."""
        return np.array([self.state], np.float32), float(self.state), True, False, {}

    @staticmethod
    def right_values(discount):
        """Returns all observations [N, 1] and their Q-values [N, A]."""
        return [[-1], [1]], [[-1], [1]]


class Delayed(gymnasium.Env):
    """Two steps, one action. The observation is -1 or 1, then half of it.

    The first reward is 0. The second is the sign of the observation.
    """

    observation_space, action_space = Box(-1, 1, (1,)), Discrete(1)

    def reset(self, *, seed=None, options=None):
        """Begins an episode."""
        super().reset(seed=seed)
        self.state = self.np_random.choice([-1.0, 1.0])
        return np.array([self.state], np.float32), {}

    def step(self, action):
        """Moves to the second step, or ends the episode."""
        last = abs(self.state) < 1
        reward = float(np.sign(self.state)) if last else 0.0
        self.state /= 2
        return np.array([self.state], np.float32), reward, last, False, {}

    @staticmethod
    def right_values(discount):
        """Returns all observations [N, 1] and their Q-values [N, A]."""
        return [[-1], [-0.5], [0.5], [1]], [[-discount], [-1], [1], [discount]]


class ByAction(gymnasium.Env):
    """One state, two actions, one step. The reward is -1 or 1, by the action."""

    observation_space, action_space = Box(-1, 1, (1,)), Discrete(2)

    def reset(self, *, seed=None, options=None):
        """Begins an episode."""
        super().reset(seed=seed)
        return np.array([1], np.float32), {}

    def step(self, action):
        """Ends the episode."""
        return np.array([1], np.float32), 2.0 * action - 1, True, False, {}

    @staticmethod
    def right_values(discount):
        """Returns all observations [N, 1] and their Q-values [N, A]."""
        return [[1]], [[-1, 1]]


class Both(gymnasium.Env):
    """Two steps, two actions. The observation is -1 or 1, then 0.

    In the first step the reward is 1 where the action fits (0 to -1, 1 to 1), else -1. In the
    second step it is that of `ByAction`.
    """

    observation_space, action_space = Box(-1, 1, (1,)), Discrete(2)

    def reset(self, *, seed=None, options=None):
        """Begins an episode."""
        super().reset(seed=seed)
        self.state = self.np_random.choice([-1, 1])
        return np.array([self.state], np.float32), {}

    def step(self, action):
        """Moves to the second step, or ends the episode."""
        reward, last = (2.0 * action - 1) * (self.state or 1), self.state == 0
        self.state = 0
        return np.array([0], np.float32), float(reward), last, False, {}

    @staticmethod
    def right_values(discount):
        """Returns all observations [N, 1] and their Q-values [N, A]."""
        right, wrong = 1 + discount, -1 + discount
        return [[-1], [0], [1]], [[right, wrong], [-1, 1], [wrong, right]]


PROBES = {
    f"{each.__name__}-v0": each for each in (OneState, ByObservation, Delayed, ByAction, Both)
}
for _name, _class in PROBES.items():
    gymnasium.register(_name, entry_point=_class)


def check(q_function, name, discount=DISCOUNT, tolerance=0.1):
    """Prints the learned beside the right Q-values; returns whether all are within `tolerance`.

    `q_function` takes observations, float32 [N, 1], and returns Q-values [N, A].
    """
    observations, right = map(np.array, PROBES[name].right_values(discount))
    learned = np.asarray(q_function(observations.astype(np.float32)))
    if learned.shape != right.shape:
        print(f"{name}: WRONG\n  the values have the shape {learned.shape}, right: {right.shape}")
        return False
    healthy = bool(np.all(np.abs(learned - right) <= tolerance))
    print(f"{name}: {'right' if healthy else 'WRONG'}")
    for observation, *both in zip(observations[:, 0], learned, right, strict=True):
        shown = (" ".join(f"{value:6.2f}" for value in values) for values in both)
        print("  s = {:4}: Q = {}, right: {}".format(observation, *shown))
    return healthy


def train_my_dqn(name, program, steps=2_000):
    """Trains the DQN of a module such as my_dqn in a probe; returns its network."""
    program.ENVIRONMENT, program.PENDULUM, program.kp = name, False, None
    program.SIZES, program.ACTIONS = (1,), np.arange(PROBES[name].action_space.n)
    program.DISCOUNT, program.REWARD_SCALE, program.FIRST_UPDATE = DISCOUNT, 1.0, 100
    return program.train(steps)[0]


if __name__ == "__main__":
    import my_dqn

    for probe in PROBES:
        if not check(train_my_dqn(probe, my_dqn), probe):
            break
