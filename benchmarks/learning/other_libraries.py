"""The training of a preset by other libraries, with the same settings.

    python -m benchmarks.learning.other_libraries    # prints which libraries are installed
    python -m benchmarks.learning.other_libraries sb3|sbx PRESET SEED OUT.npz

Trains a DQN of Stable-Baselines3 (PyTorch) or of sbx (JAX) and writes the network's weights to
OUT.npz, in Keras's order. Needs the extra `peers`. PRESET is `reference` or `swingup`. The settings
are those of the preset, except where the libraries differ: both use the Huber loss of the taken
action and their own initial weights. Neither averages its weights, as `swingup` does
(`average_updates`). Both count the period of the target update in steps, so they make their
updates, as many as here, after every few steps and not after the episode.
"""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from benchmarks.result_files import versions
from keras_pendulum.config.config import Config
from keras_pendulum.config.presets import preset
from keras_pendulum.environments.actions import TorqueGrid


class TrainingPendulum(gymnasium.Wrapper[Any, Any, Any, Any]):
    """The pendulum with the index of a torque as its action, and scaled rewards."""

    def __init__(self, config: Config) -> None:
        super().__init__(config.task.make_env(steps=config.max_episode_steps))
        self._reward_scale = config.reward_scale
        self._torques = TorqueGrid(config.torque_count)
        self.action_space = gymnasium.spaces.Discrete(config.torque_count)

    def step(self, action: Any) -> Any:
        """Makes a step with the torque of this index; returns what Gymnasium returns."""
        torque = self._torques.to_env_action(int(action))
        observation, reward, *rest = self.env.step(torque)
        return observation, self._reward_scale * float(reward), *rest


def common_settings(config: Config) -> dict[str, Any]:
    """Returns the arguments that both libraries understand."""
    periods = math.gcd(config.max_episode_steps, config.updates_per_episode)  # per episode
    steps, updates = config.max_episode_steps // periods, config.updates_per_episode // periods
    return {
        "env": TrainingPendulum(config),
        "buffer_size": config.replay_capacity,
        "learning_starts": config.warmup_episodes * config.max_episode_steps,
        "batch_size": config.batch_size,
        "gamma": config.discount,
        "tau": 1 - (1 - config.tau) ** updates,
        "target_update_interval": steps,
        "train_freq": (steps, "step"),
        "gradient_steps": updates,
        "seed": config.seed,
        "device": "cpu",
    }


def learning_rate_schedule(config: Config) -> Callable[[float], float]:
    """Returns the cosine schedule; its argument is the remaining share of the run."""
    low, high = config.learning_rate_min, config.learning_rate
    return lambda remaining: low + (high - low) * (1 - math.cos(math.pi * remaining)) / 2


def epsilon_schedule(config: Config) -> Callable[[float], float]:
    """Returns the schedule of ε; its argument is the remaining share of the run."""

    def schedule(remaining: float) -> float:
        episode = int((1 - remaining) * config.episodes)
        return max(config.epsilon_min, config.epsilon_start * config.epsilon_decay ** (episode + 1))

    return schedule


def train_sb3(config: Config) -> list[NDArray[np.float32]]:
    """Trains with Stable-Baselines3; returns the weights."""
    import stable_baselines3
    import torch

    model = stable_baselines3.DQN(
        "MlpPolicy",
        learning_rate=learning_rate_schedule(config),
        max_grad_norm=math.inf,
        policy_kwargs={"net_arch": list(config.hidden_units), "activation_fn": torch.nn.Tanh},
        **common_settings(config),
    )
    model.exploration_schedule = epsilon_schedule(config)
    model.learn(config.episodes * config.max_episode_steps)
    parameters = model.q_net.q_net.parameters()
    return [parameter.detach().numpy().T for parameter in parameters]


def train_sbx(config: Config) -> list[NDArray[np.float32]]:
    """Trains with sbx; returns the weights.

    The network of sbx has two hidden layers of the same width, so another class replaces it.
    """
    import flax.linen as nn
    import optax
    import sbx
    import sbx.dqn.policies

    widths = (*config.hidden_units, config.torque_count)

    class Network(nn.Module):
        n_actions: int
        n_units: int
        activation_fn: Any

        @nn.compact
        def __call__(self, features: Any) -> Any:
            for width in widths[:-1]:
                features = nn.tanh(nn.Dense(width)(features))
            return nn.Dense(self.n_actions)(features)

    def adam(learning_rate: float) -> optax.GradientTransformation:
        return optax.adam(
            optax.cosine_decay_schedule(
                config.learning_rate,
                max(1, config.total_updates),
                alpha=config.learning_rate_min / config.learning_rate,
            )
        )

    sbx.dqn.policies.QNetwork = Network
    model = sbx.DQN(
        "MlpPolicy",
        learning_rate=config.learning_rate,
        policy_kwargs={"optimizer_class": adam},
        **common_settings(config),
    )
    model.exploration_schedule = epsilon_schedule(config)
    model.learn(config.episodes * config.max_episode_steps)
    layers = model.policy.qf_state.params["params"]
    arrays = [layers[f"Dense_{i}"][part] for i in range(len(widths)) for part in ("kernel", "bias")]
    return [np.asarray(array) for array in arrays]


def main(
    library: str | None = None, name: str = "reference", seed: str = "0", out: str = ""
) -> None:
    """Trains and writes the weights, or prints which libraries are installed."""
    if library is None:
        print("\n".join(versions(["stable-baselines3", "torch", "sbx-rl", "jax"])))
        return
    os.environ.pop("XLA_FLAGS", None)  # JAX reads it, too
    train = {"sb3": train_sb3, "sbx": train_sbx}[library]
    np.savez(out, *train(preset(name, seed=int(seed))))


if __name__ == "__main__":
    main(*sys.argv[1:])
