"""The losses, the target network and the agent in PyTorch, to check the numbers of every update.

It imports nothing of the package. Its functions have the names of those in keras_pendulum/dqn:
losses.py, target_network.py and agent.py, in this order. test_torch.py compares both.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

BETAS = (0.9, 0.999)  # Adam's decay rates of both moments, the same in Keras and PyTorch
KERAS_EPSILON = 1e-7  # PyTorch's default is 1e-8


class Transitions(NamedTuple):
    """Transitions of shape [B] for a batch, or [K, B] for K batches."""

    observation: Tensor  # [..., D] float32
    action: Tensor  # [...] integer, index of the action
    reward: Tensor  # [...] float32
    next_observation: Tensor  # [..., D] float32
    terminated: Tensor  # [...] bool


class DQN(nn.Sequential):
    """Linear layers with an activation between them: observations [B, D] in, Q-values [B, A] out.

    Args:
        sizes: the widths from input to output, such as (3, 512, 256, 128, 41).
        activation: makes the layer after each hidden one.
    """

    def __init__(self, sizes: Sequence[int], activation: Callable[[], nn.Module] = nn.Tanh) -> None:
        layers: list[nn.Module] = []
        for inputs, outputs in pairwise(sizes):
            layers += [nn.Linear(inputs, outputs), activation()]
        super().__init__(*layers[:-1])  # the output is linear


def from_keras(
    weights: Sequence[NDArray[np.float32]], activation: Callable[[], nn.Module] = nn.Tanh
) -> DQN:
    """Returns the network with the weights of Keras's `get_weights()`.

    Args:
        weights: kernel [in, out] and bias [out] of each layer.
        activation: as in `DQN`.
    """
    network = DQN([kernel.shape[0] for kernel in weights[::2]] + [len(weights[-1])], activation)
    with torch.no_grad():
        for parameter, array in zip(network.parameters(), weights, strict=True):
            parameter.copy_(torch.tensor(array.T))  # a kernel is [out, in] in PyTorch
    return network


def to_keras(network: nn.Module) -> list[NDArray[np.float32]]:
    """Returns copies of the weights as Keras's `set_weights` takes them."""
    return [parameter.detach().numpy().T.copy() for parameter in network.parameters()]


def td_target(reward: Tensor, terminated: Tensor, next_q: Tensor, discount: float) -> Tensor:
    """Returns the TD target r + γ·max Q(next) [B]; after termination it is r.

    Args:
        reward: [B].
        terminated: [B].
        next_q: [B, A], the target network's values of the next observations.
        discount: γ.
    """
    bootstrap = torch.where(terminated, 0.0, discount * next_q.amax(dim=1))  # [B]
    return (reward + bootstrap).detach()


def double_td_target(
    reward: Tensor, terminated: Tensor, next_q: Tensor, next_q_online: Tensor, discount: float
) -> Tensor:
    """Returns the TD target [B] with the next action chosen by the online values [B, A]."""
    next_action = next_q_online.argmax(dim=1, keepdim=True)  # [B, 1]
    value = next_q.gather(1, next_action)[:, 0]  # [B]
    return (reward + torch.where(terminated, 0.0, discount * value)).detach()


def mean_squared_error(q: Tensor, action: Tensor, target: Tensor) -> Tensor:
    """Returns the squared TD error of q [B, A], averaged over all B·A outputs."""
    taken = nn.functional.one_hot(action.long(), q.shape[1]).bool()  # [B, A]
    target_q = torch.where(taken, target[:, None], q.detach())  # [B, A]
    return (target_q - q).square().mean()


def huber(q: Tensor, action: Tensor, target: Tensor) -> Tensor:
    """Returns the Huber loss of the taken actions, δ = 1, batch mean."""
    taken = nn.functional.one_hot(action.long(), q.shape[1])  # [B, A]
    error = (taken * q).sum(dim=1) - target  # [B]
    size = error.abs()
    return torch.where(size < 1.0, 0.5 * error.square(), size - 0.5).mean()


# Returns the TD targets [B] from the online network, the target network, a batch [B, ...] and γ.
TargetRule = Callable[[nn.Module, nn.Module, Transitions, float], Tensor]
# Called after each gradient step with the online network, the target network and the number of
# gradient steps so far. `partial` makes one of `soft_update` or `hard_update`.
TargetUpdate = Callable[[nn.Module, nn.Module, int], None]


def q_learning(online: nn.Module, target: nn.Module, batch: Transitions, discount: float) -> Tensor:
    """Returns the TD targets [B] with next actions that `target` chooses and values."""
    next_q = target(batch.next_observation)  # [B, A]
    return td_target(batch.reward, batch.terminated, next_q, discount)


def double_q_learning(
    online: nn.Module, target: nn.Module, batch: Transitions, discount: float
) -> Tensor:
    """Returns the TD targets [B] with next actions that `online` chooses and `target` values."""
    next_q = target(batch.next_observation)  # [B, A]
    next_q_online = online(batch.next_observation)  # [B, A]
    return double_td_target(batch.reward, batch.terminated, next_q, next_q_online, discount)


def soft_update(tau: float, online: nn.Module, target: nn.Module, steps: int) -> None:
    """Moves target ← tau·online + (1 - tau)·target."""
    for source, destination in zip(online.parameters(), target.parameters(), strict=True):
        destination.copy_(tau * source + (1.0 - tau) * destination)


def hard_update(period: int, online: nn.Module, target: nn.Module, steps: int) -> None:
    """Copies target ← online at every `period`-th gradient step."""
    if steps % period == 0:
        target.load_state_dict(online.state_dict())


def no_update(online: nn.Module, target: nn.Module, steps: int) -> None:
    """Does nothing: the target network is the online network."""


def constant_rate(rate: float) -> Callable[[int], float]:
    """Returns a schedule with the same learning rate for every step."""
    return lambda steps: rate


def cosine_rate(first: float, last_step: int) -> Callable[[int], float]:
    """Returns a schedule that falls from `first` to 0 at `last_step`, and stays there."""
    return lambda steps: first * (1 + math.cos(math.pi * min(steps / last_step, 1))) / 2


def keras_epsilon(step: int, epsilon: float = KERAS_EPSILON) -> float:
    """Returns the ε with which PyTorch's Adam makes Keras's step number `step` (from 1).

    Keras adds its ε to √v before the bias correction of v, PyTorch after it. So Keras's ε is
    divided by √(1 - β₂ᵗ) too: at step 1 it is 30 times larger.
    """
    return epsilon / math.sqrt(1 - BETAS[1] ** step)


class KerasAdam(torch.optim.Adam):
    """PyTorch's Adam with the numbers of Keras's.

    Args:
        parameters: of the online network.
        learning_rate: a schedule, called with the number of steps before.
    """

    def __init__(self, parameters: Iterable[Tensor], learning_rate: Callable[[int], float]) -> None:
        super().__init__(parameters, betas=BETAS)
        self.learning_rate = learning_rate
        self.iterations = 0

    def step(self, closure: Any = None) -> Any:
        """Makes one step."""
        (settings,) = self.param_groups
        settings["lr"] = self.learning_rate(self.iterations)
        self.iterations += 1
        settings["eps"] = keras_epsilon(self.iterations)
        return super().step(closure)


@dataclass(eq=False)
class Agent:
    """The update of Mnih et al. 2015."""

    online: DQN  # the network that learns
    target: DQN  # the network that values the next observations
    target_rule: TargetRule  # makes the TD targets
    update_target: TargetUpdate  # changes `target` after each gradient step
    optimizer: KerasAdam  # of the parameters of `online`
    # Returns a scalar from Q-values [B, A], actions [B] and TD targets [B].
    loss: Callable[[Tensor, Tensor, Tensor], Tensor]
    discount: float  # γ

    def update(self, batches: Transitions) -> NDArray[np.float32]:
        """Makes one gradient step for each of the batches [K, B, ...]; returns the losses [K]."""
        losses = [self.gradient_step(Transitions(*batch)) for batch in zip(*batches, strict=True)]
        return torch.stack(losses).numpy()

    def gradient_step(self, batch: Transitions) -> Tensor:
        """Makes one gradient step from a batch [B, ...]; returns its loss, a scalar."""
        with torch.no_grad():
            target = self.target_rule(self.online, self.target, batch, self.discount)  # [B]
        q = self.online(batch.observation)  # [B, A]
        loss = self.loss(q, batch.action, target)
        self.optimizer.zero_grad()
        loss.backward()
        self.optimizer.step()
        with torch.no_grad():
            self.update_target(self.online, self.target, self.optimizer.iterations)
        return loss.detach()
