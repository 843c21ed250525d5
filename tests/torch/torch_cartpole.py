"""The CartPole program of the notebooks in PyTorch: network, replay buffer, agent and loop.

    python tests/torch/torch_cartpole.py OUT.npz [SEED [EPISODES]]

records a run. Of the package it uses only the random-number generators, so that both programs can
have the same draws. test_torch_cartpole.py compares both, and
benchmarks/learning/cartpole_beside_pytorch.py times them.
"""

from __future__ import annotations

import math
import sys
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from random import Random
from typing import Any

import gymnasium
import numpy as np
import torch
import torch_agent
from numpy.typing import NDArray
from torch import nn
from torch_agent import DQN, Transitions, from_keras, to_keras

from keras_pendulum.dqn.random_streams import RandomStreams

REPLAY_CAPACITY = 10_000  # transitions
BATCH_SIZE = 128
DISCOUNT = 0.99
EPSILON_START, EPSILON_MIN, EPSILON_DECAY_STEPS = 0.9, 0.05, 1000
GRADIENT_CLIP = 100.0
LEARNING_RATE = 1e-4
TAU = 0.005


def network(weights: Sequence[NDArray[np.float32]] | None = None) -> DQN:
    """Returns the network 4-128-128-2 with ReLU.

    Args:
        weights: as Keras's `get_weights` returns them; None for PyTorch's own initial weights.
    """
    return DQN((4, 128, 128, 2), nn.ReLU) if weights is None else from_keras(weights, nn.ReLU)


def torch_epsilon(step: int) -> float:
    """Returns the ε of PyTorch's optimizers, the same at every step."""
    return 1e-8


# The ε with which PyTorch makes Keras's steps.
keras_epsilon = partial(torch_agent.keras_epsilon, epsilon=1e-8)


class Agent:
    """Online network, target network, and the update of the notebooks.

    Args:
        weights: initial weights, as Keras's `get_weights` returns them.
        epsilon: AdamW's ε, called with the number of the step (from 1).
    """

    def __init__(
        self,
        weights: Sequence[NDArray[np.float32]],
        epsilon: Callable[[int], float] = torch_epsilon,
    ) -> None:
        self.online = network(weights)
        self.target = network(weights)
        self.optimizer = torch.optim.AdamW(self.online.parameters(), lr=LEARNING_RATE, amsgrad=True)
        self.epsilon = epsilon
        self.steps = 0

    def gradient_step(self, batch: Transitions) -> float:
        """Makes one gradient step from a batch [B, ...]; returns its loss."""
        q = self.online(batch.observation)  # [B, 2]
        q = q.gather(1, batch.action.long()[:, None])[:, 0]  # [B]
        next_q = torch.zeros(len(batch.reward))  # [B]
        bootstraps = ~batch.terminated  # [B]
        with torch.no_grad():
            next_q[bootstraps] = self.target(batch.next_observation[bootstraps]).max(1).values
        loss = nn.functional.smooth_l1_loss(q, batch.reward + DISCOUNT * next_q)
        self.steps += 1
        self.optimizer.param_groups[0]["eps"] = self.epsilon(self.steps)
        self.optimizer.zero_grad()
        loss.backward()
        nn.utils.clip_grad_value_(self.online.parameters(), GRADIENT_CLIP)
        self.optimizer.step()
        source, destination = self.online.state_dict(), self.target.state_dict()
        for name in source:
            destination[name] = TAU * source[name] + (1 - TAU) * destination[name]
        self.target.load_state_dict(destination)
        return loss.item()


def train_episodes(agent: Agent, seed: int, count: int) -> Iterator[list[int]]:
    """Trains for `count` episodes; yields the actions of each."""
    env = gymnasium.make("CartPole-v1")
    streams = RandomStreams(seed)
    replay: deque[Transitions] = deque(maxlen=REPLAY_CAPACITY)
    steps = 0
    for episode in range(count):
        reset_observation, _ = env.reset(seed=seed if episode == 0 else None)
        observation = torch.tensor(reset_observation)[None]  # [1, 4]
        actions: list[int] = []
        done = False
        while not done:
            decay = math.exp(-steps / EPSILON_DECAY_STEPS)
            epsilon = EPSILON_MIN + (EPSILON_START - EPSILON_MIN) * decay
            steps += 1
            if streams.exploration.random_sample() > epsilon:
                with torch.no_grad():
                    action = agent.online(observation).max(1).indices  # [1]
            else:
                action = torch.tensor([int(streams.exploration.randint(2))])
            result, reward, terminated, truncated, _ = env.step(action.item())
            next_observation = torch.tensor(result)[None]
            replay.append(
                Transitions(
                    observation,
                    action,
                    torch.tensor([reward], dtype=torch.float32),
                    next_observation,
                    torch.tensor([terminated]),
                )
            )
            observation = next_observation
            actions.append(int(action))
            if len(replay) >= BATCH_SIZE:
                agent.gradient_step(sample(replay, streams.replay))
            done = terminated or truncated
        yield actions


def sample(replay: deque[Transitions], rng: Random) -> Transitions:
    """Returns a batch, drawn without replacement."""
    rows = rng.sample(replay, BATCH_SIZE)
    return Transitions(*map(torch.cat, zip(*rows, strict=True)))


def main(out: str, seed: str = "0", count: str = "150") -> None:
    """Records a run from PyTorch's initial weights, with Adam's ε where Keras has it."""
    torch.manual_seed(int(seed))
    initial = to_keras(network())
    episodes = list(train_episodes(Agent(initial, keras_epsilon), int(seed), int(count)))
    arrays: dict[str, NDArray[Any]] = {
        "seed": np.array(int(seed)),
        "steps": np.array([len(actions) for actions in episodes]),  # of each episode
        "actions": np.packbits(np.concatenate(episodes).astype(bool)),
        **{f"initial_weight_{i}": array for i, array in enumerate(initial)},
    }
    np.savez_compressed(out, allow_pickle=False, **arrays)


if __name__ == "__main__":
    main(*sys.argv[1:])
