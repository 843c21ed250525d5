"""The notebooks' CartPole program once more, in PyTorch: network, memory, learning and loop.

    python tests/torch_cartpole.py OUT.npz [SEED [EPISODES]]

records a run. It reads on its own; only the draws for exploration come from the package, so that
both can make the same ones. tests/test_torch_cartpole.py holds the two against each other, and
benchmarks/cartpole.py races them.
"""

from __future__ import annotations

import math
import sys
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from random import Random
from typing import Any, NamedTuple

import gymnasium
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from keras_pendulum.randomness import RandomSource

BATCH_SIZE = 128
DISCOUNT = 0.99
MEMORY = 10_000  # transitions
LEARNING_RATE = 1e-4
BLEND = 0.005
EPSILON_START, EPSILON_END, EPSILON_STEPS = 0.9, 0.05, 1000


def network(weights: Sequence[NDArray[np.float32]] | None = None) -> nn.Sequential:
    """4-128-128-2 with ReLU; its own initial weights, or those of Keras's `get_weights()`."""
    layers = nn.Sequential(
        nn.Linear(4, 128), nn.ReLU(), nn.Linear(128, 128), nn.ReLU(), nn.Linear(128, 2)
    )
    if weights is not None:
        with torch.no_grad():
            for parameter, array in zip(layers.parameters(), weights, strict=True):
                parameter.copy_(torch.tensor(array.T))  # torch keeps a kernel as [out, in]
    return layers


def to_keras(layers: nn.Module) -> list[NDArray[np.float32]]:
    """Copies of the weights as Keras's `set_weights` takes them."""
    return [parameter.detach().numpy().T.copy() for parameter in layers.parameters()]


def torch_epsilon(step: int) -> float:
    """ε of torch's optimizers, the same at every step (from 1)."""
    return 1e-8


def keras_epsilon(step: int) -> float:
    """The ε with which torch makes the step that Keras makes with 1e-8 (torch_agent.py)."""
    return 1e-8 / math.sqrt(1 - 0.999**step)


class Batch(NamedTuple):
    """Transitions: one [1] in the memory, many [B] in an update."""

    observation: Tensor  # [B, 4] float32
    action: Tensor  # [B] integer
    reward: Tensor  # [B] float32
    next_observation: Tensor  # [B, 4] float32
    terminated: Tensor  # [B] bool


class Learner:
    """Policy network, target network, and the update of the notebooks.

    Args:
        weights: initial ones, as Keras gives them.
        epsilon: of AdamW, from the number of the step.
    """

    def __init__(
        self,
        weights: Sequence[NDArray[np.float32]],
        epsilon: Callable[[int], float] = torch_epsilon,
    ) -> None:
        self.policy = network(weights)
        self.target = network(weights)
        self.optimizer = torch.optim.AdamW(self.policy.parameters(), lr=LEARNING_RATE, amsgrad=True)
        self.epsilon = epsilon
        self.updates = 0

    def update(self, batch: Batch) -> float:
        """One update of the policy, then of the target network; returns the loss."""
        values = self.policy(batch.observation)  # [B, 2]
        values = values.gather(1, batch.action.long()[:, None])[:, 0]  # [B]
        following = torch.zeros(len(batch.reward))  # [B]
        goes_on = ~batch.terminated  # [B]
        with torch.no_grad():
            following[goes_on] = self.target(batch.next_observation[goes_on]).max(1).values
        loss = nn.functional.smooth_l1_loss(values, batch.reward + DISCOUNT * following)
        self.updates += 1
        self.optimizer.param_groups[0]["eps"] = self.epsilon(self.updates)
        self.optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        nn.utils.clip_grad_value_(self.policy.parameters(), 100)
        self.optimizer.step()
        ours, theirs = self.policy.state_dict(), self.target.state_dict()
        for name in ours:
            theirs[name] = BLEND * ours[name] + (1 - BLEND) * theirs[name]
        self.target.load_state_dict(theirs)
        return loss.item()


def episodes(learner: Learner, seed: int, count: int) -> Iterator[list[int]]:
    """Trains; yields the actions of each episode, one a step."""
    env = gymnasium.make("CartPole-v1")
    random, batches = RandomSource(seed), Random(seed)
    memory: deque[Batch] = deque(maxlen=MEMORY)
    steps = 0
    for episode in range(count):
        observation, _ = env.reset(seed=seed if episode == 0 else None)
        state = torch.tensor(observation)[None]  # [1, 4]
        actions: list[int] = []
        over = False
        while not over:
            epsilon = EPSILON_END + (EPSILON_START - EPSILON_END) * math.exp(-steps / EPSILON_STEPS)
            steps += 1
            if random.uniform() > epsilon:
                with torch.no_grad():
                    action = learner.policy(state).max(1).indices  # [1]
            else:
                action = torch.tensor([random.action(2)])
            observation, reward, terminated, truncated, _ = env.step(action.item())
            following = torch.tensor(observation)[None]
            earned = torch.tensor([reward], dtype=torch.float32)
            memory.append(Batch(state, action, earned, following, torch.tensor([terminated])))
            state = following
            actions.append(int(action))
            if len(memory) >= BATCH_SIZE:
                learner.update(drawn(memory, batches))
            over = terminated or truncated
        yield actions


def drawn(memory: deque[Batch], random: Random) -> Batch:
    """A batch of what the memory holds, without replacement."""
    rows = random.sample(memory, BATCH_SIZE)
    return Batch(*map(torch.cat, zip(*rows, strict=True)))


def main(out: str, seed: str = "0", count: str = "150") -> None:
    """Records a run from torch's own initial weights, ε placed as Keras places it."""
    torch.manual_seed(int(seed))
    initial = to_keras(network())
    learner = Learner(initial, keras_epsilon)
    run = list(episodes(learner, int(seed), int(count)))
    arrays: dict[str, NDArray[Any]] = {
        "seed": np.array(int(seed)),
        "steps": np.array([len(actions) for actions in run]),  # of each episode
        "actions": np.packbits(np.concatenate(run).astype(bool)),
        **{f"initial_weight_{i}": array for i, array in enumerate(initial)},
    }
    np.savez_compressed(out, allow_pickle=False, **arrays)


if __name__ == "__main__":
    main(*sys.argv[1:])
