"""The task of `reference` done by other libraries, with the same numbers.

    python -m benchmarks.peers              # which of them are installed
    python -m benchmarks.peers sb3|sbx SEED OUT.npz

Trains a DQN of Stable-Baselines3 (PyTorch) or of sbx (JAX) and keeps the network's weights in
OUT.npz, in Keras's order. Needs the extra `bench`. The settings come from the preset. Where a
library has no such setting, it keeps its own way: both take the Huber loss of the taken action, and
count the blend of the target network in steps, so that their updates, as many as here, come after
a few steps each and not after the episode.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from benchmarks.report import versions
from keras_pendulum.config import Config
from keras_pendulum.environment import make_environment
from keras_pendulum.presets import preset
from keras_pendulum.torque import TorqueGrid


class DiscreteTorques(gymnasium.ActionWrapper[Any, Any, Any]):
    """The pendulum with an index as its action."""

    def __init__(self, config: Config) -> None:
        super().__init__(
            make_environment(config.environment, config.gravity, steps=config.episode_steps)
        )
        self._torques = TorqueGrid(config.torque_count)
        self.action_space = gymnasium.spaces.Discrete(config.torque_count)

    def action(self, action: Any) -> NDArray[np.float64]:
        """The torque [1] in N·m."""
        return self._torques.control(int(action))


def settings(config: Config) -> dict[str, Any]:
    """The arguments that both libraries understand."""
    times = math.gcd(config.episode_steps, config.updates_per_episode)  # in an episode
    steps, updates = config.episode_steps // times, config.updates_per_episode // times
    return {
        "env": DiscreteTorques(config),
        "buffer_size": config.replay_capacity,
        "learning_starts": (config.learning_starts + 1) * config.episode_steps,
        "batch_size": config.batch_size,
        "gamma": config.discount,
        "tau": 1 - (1 - config.target_blend) ** updates,
        "target_update_interval": steps,
        "train_freq": (steps, "step"),
        "gradient_steps": updates,
        "seed": config.seed,
        "device": "cpu",
    }


def cosine(config: Config) -> Callable[[float], float]:
    """The learning rate by the share of the run that remains."""
    return lambda remaining: config.learning_rate * (1 - math.cos(math.pi * remaining)) / 2


def epsilon(config: Config) -> Callable[[float], float]:
    """ε by the share of the run that remains."""

    def schedule(remaining: float) -> float:
        episode = int((1 - remaining) * config.episodes)
        return max(config.epsilon_min, config.epsilon_start * config.epsilon_decay ** (episode + 1))

    return schedule


def train_sb3(config: Config) -> list[NDArray[np.float32]]:
    """Stable-Baselines3's DQN."""
    import stable_baselines3
    import torch

    model = stable_baselines3.DQN(
        "MlpPolicy",
        learning_rate=cosine(config),
        max_grad_norm=math.inf,
        policy_kwargs={"net_arch": list(config.hidden_units), "activation_fn": torch.nn.Tanh},
        **settings(config),
    )
    model.exploration_schedule = epsilon(config)
    model.learn(config.episodes * config.episode_steps)
    parameters = model.q_net.q_net.parameters()
    return [parameter.detach().numpy().T for parameter in parameters]


def train_sbx(config: Config) -> list[NDArray[np.float32]]:
    """The DQN of sbx, which always has two hidden layers of one width unless given another."""
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
            optax.cosine_decay_schedule(config.learning_rate, max(1, config.total_updates))
        )

    sbx.dqn.policies.QNetwork = Network
    model = sbx.DQN(
        "MlpPolicy",
        learning_rate=config.learning_rate,
        policy_kwargs={"optimizer_class": adam},
        **settings(config),
    )
    model.exploration_schedule = epsilon(config)
    model.learn(config.episodes * config.episode_steps)
    layers = model.policy.qf_state.params["params"]
    arrays = [layers[f"Dense_{i}"][part] for i in range(len(widths)) for part in ("kernel", "bias")]
    return [np.asarray(array) for array in arrays]


def main(library: str | None = None, seed: str = "0", out: str = "") -> None:
    """Trains and keeps the weights, or names what is installed."""
    if library is None:
        print("\n".join(versions(["stable-baselines3", "torch", "sbx-rl", "jax"])))
        return
    train = {"sb3": train_sb3, "sbx": train_sbx}[library]
    np.savez(out, *train(preset("reference", seed=int(seed))))


if __name__ == "__main__":
    main(*sys.argv[1:])
