"""The agent's learning once more, in PyTorch: a second opinion on every number of an update.

It reads on its own. Beside it lie keras_pendulum/q_learning.py, target_network.py and agent.py,
whose functions have the same names; tests/test_torch.py holds the two against each other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

BETAS = (0.9, 0.999)  # Adam's decay of the first and of the second moment, in both frameworks
KERAS_EPSILON = 1e-7  # torch's own default is 1e-8


class Batch(NamedTuple):
    """Transitions to learn from in one update."""

    observation: Tensor  # [B, 3] float32
    action: Tensor  # [B] integer, the index of the torque
    reward: Tensor  # [B] float32
    next_observation: Tensor  # [B, 3] float32
    terminated: Tensor  # [B] bool


class DQN(nn.Sequential):
    """Linear layers with tanh between them: observations [B, 3] in, Q-values [B, A] out.

    Args:
        sizes: the widths from the input to the output, e.g. (3, 512, 256, 128, 41).
    """

    def __init__(self, sizes: Sequence[int]) -> None:
        layers: list[nn.Module] = []
        for inputs, outputs in pairwise(sizes):
            layers += [nn.Linear(inputs, outputs), nn.Tanh()]
        super().__init__(*layers[:-1])  # the head stays linear


def from_keras(weights: Sequence[NDArray[np.float32]]) -> DQN:
    """The network of Keras's `get_weights()`: kernel [in, out] and bias [out] of each layer."""
    network = DQN([kernel.shape[0] for kernel in weights[::2]] + [len(weights[-1])])
    with torch.no_grad():
        for parameter, array in zip(network.parameters(), weights, strict=True):
            parameter.copy_(torch.tensor(array.T))  # torch keeps a kernel as [out, in]
    return network


def to_keras(network: DQN) -> list[NDArray[np.float32]]:
    """Copies of the weights as Keras's `set_weights` takes them."""
    return [parameter.detach().numpy().T.copy() for parameter in network.parameters()]


def td_target(reward: Tensor, terminated: Tensor, next_q: Tensor, discount: float) -> Tensor:
    """r + γ·max Q(next), without the second term after termination.

    reward [B], terminated [B] and next_q [B, A] in, [B] out; no gradient flows through it.
    """
    bootstrap = torch.where(terminated, 0.0, discount * next_q.amax(dim=1))  # [B]
    return (reward + bootstrap).detach()


def double_td_target(
    reward: Tensor, terminated: Tensor, next_q: Tensor, next_q_online: Tensor, discount: float
) -> Tensor:
    """The same, with the next action chosen by the online network's values [B, A]."""
    best = next_q_online.argmax(dim=1, keepdim=True)  # [B, 1]
    bootstrap = torch.where(terminated, 0.0, discount * next_q.gather(1, best)[:, 0])  # [B]
    return (reward + bootstrap).detach()


def mean_squared_error(q: Tensor, action: Tensor, target: Tensor) -> Tensor:
    """The squared error averaged over all B·A outputs; an output not taken is its own target.

    q [B, A], action [B] and target [B] in, a scalar out.
    """
    taken = nn.functional.one_hot(action.long(), q.shape[1]).bool()  # [B, A]
    target_q = torch.where(taken, target[:, None], q.detach())  # [B, A]
    return (target_q - q).square().mean()


def constant_rate(rate: float) -> Callable[[int], float]:
    """The same learning rate for every update."""
    return lambda updates: rate


def cosine_rate(first: float, last_update: int) -> Callable[[int], float]:
    """Half a cosine: `first` after 0 updates, 0 after `last_update` updates and ever after."""
    return lambda updates: first * (1 + math.cos(math.pi * min(updates / last_update, 1))) / 2


def keras_epsilon(step: int) -> float:
    """The ε with which torch's Adam makes Keras's step number `step` (from 1).

    Keras adds its ε to √v before v's bias is corrected, torch afterwards, so Keras's ε is divided
    by the correction √(1 - β₂ᵗ) as well: at step 1 it acts 30 times larger.
    """
    return KERAS_EPSILON / math.sqrt(1 - BETAS[1] ** step)


# How the target network follows the online one; called with both and the updates made so far.
TargetUpdate = Callable[[DQN, DQN, int], None]


def soft_update(blend: float) -> TargetUpdate:
    """target ← blend·online + (1 - blend)·target, after every update."""

    def update(online: DQN, target: DQN, updates: int) -> None:
        for ours, theirs in zip(online.parameters(), target.parameters(), strict=True):
            theirs.copy_(blend * ours + (1 - blend) * theirs)

    return update


def hard_update(period: int) -> TargetUpdate:
    """target ← online at every `period`-th update, nothing in between."""

    def update(online: DQN, target: DQN, updates: int) -> None:
        if updates % period == 0:
            target.load_state_dict(online.state_dict())

    return update


class Agent:
    """Updates an online network.

    Args:
        weights: the initial weights, as Keras gives them.
        discount: γ.
        learning_rate: Adam's step size, from the number of updates made before.
        update_target: None makes the online network its own target.
        epsilon: Adam's ε in torch's place, from the number of the step.
        double_q: whether the online network chooses the next action.
    """

    def __init__(
        self,
        weights: Sequence[NDArray[np.float32]],
        discount: float,
        learning_rate: Callable[[int], float],
        update_target: TargetUpdate | None = None,
        epsilon: Callable[[int], float] = keras_epsilon,
        double_q: bool = False,
    ) -> None:
        self.online = from_keras(weights)
        self.target = self.online if update_target is None else from_keras(weights)
        self.discount = discount
        self.learning_rate = learning_rate
        self.update_target = update_target
        self.epsilon = epsilon
        self.double_q = double_q
        self.optimizer = torch.optim.Adam(self.online.parameters(), betas=BETAS)
        self.updates = 0

    def update(self, batch: Batch) -> float:
        """One update; returns the loss before it."""
        (settings,) = self.optimizer.param_groups
        settings["lr"] = self.learning_rate(self.updates)
        settings["eps"] = self.epsilon(self.updates + 1)
        with torch.no_grad():
            outcome = (batch.reward, batch.terminated, self.target(batch.next_observation))
            if self.double_q:
                next_q_online = self.online(batch.next_observation)  # [B, A]
                target = double_td_target(*outcome, next_q_online, self.discount)  # [B]
            else:
                target = td_target(*outcome, self.discount)  # [B]
        loss = mean_squared_error(self.online(batch.observation), batch.action, target)
        self.optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        self.optimizer.step()
        self.updates += 1
        if self.update_target is not None:
            with torch.no_grad():
                self.update_target(self.online, self.target, self.updates)
        return loss.item()
