"""Stable-Baselines3's DQN on the pendulum with 11 torques: `python examples/sb3_dqn.py`.

A DQN needs discrete actions, and the pendulum takes a torque. So a wrapper maps each index to a
torque, and the evaluation gets the same list. It needs `pip install stable-baselines3`, besides
this package.
"""

import gymnasium
import numpy as np

import keras_pendulum as kp

TORQUES = np.linspace(-2, 2, 11)  # N·m
DISCOUNT = 0.985  # γ
STEPS = 40_000  # of the environment


class DiscreteTorques(gymnasium.ActionWrapper):
    """The pendulum with the indices of `TORQUES` as its actions."""

    def __init__(self, env):
        super().__init__(env)
        self.action_space = gymnasium.spaces.Discrete(len(TORQUES))

    def action(self, action):
        """Returns the torque of an index, as the environment takes it."""
        return np.array([TORQUES[action]], np.float32)


def make_env():
    """Returns the pendulum with discrete torques, and rewards that give values of a few units."""
    env = DiscreteTorques(gymnasium.make("Pendulum-v1"))  # g = 10 m/s²
    return gymnasium.wrappers.TransformReward(env, lambda reward: 0.02 * reward)


def train(env, steps=STEPS, seed=0):
    """Returns a trained model; its numbers are those of examples/my_dqn.py where SB3 has them."""
    from stable_baselines3 import DQN

    model = DQN(
        "MlpPolicy",
        env,
        learning_rate=lambda left: 1e-3 * left,  # falls to 0
        buffer_size=50_000,
        learning_starts=1_000,
        batch_size=128,
        gamma=DISCOUNT,
        train_freq=2,
        gradient_steps=1,
        target_update_interval=100,  # steps: 50 updates
        exploration_fraction=0.5,
        exploration_initial_eps=1.0,
        exploration_final_eps=0.05,
        policy_kwargs={"net_arch": [64, 64]},
        seed=seed,
        device="cpu",
    )
    return model.learn(steps)


if __name__ == "__main__":
    env = make_env()
    model = train(env)
    task = {"gravity": 10.0, "torques": TORQUES, "discount": DISCOUNT}
    print(kp.evaluate_policy(model, **task).summary())
