"""The network of a small DQN program in PyTorch, with the mistakes of `stranger_programs`."""

from __future__ import annotations

import copy
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import torch
from torch import nn

from benchmarks.diagnosis.stranger_programs import Array, Program


class TorchNetwork:
    """The online and the target network, and Adam."""

    def __init__(self, program: Program) -> None:
        torch.set_num_threads(1)
        torch.manual_seed(program.seed)
        activation = nn.Tanh if program.activation == "tanh" else nn.ReLU
        layers: list[nn.Module] = []
        sizes = [program.observation_size, *program.hidden]
        for inputs, outputs in pairwise(sizes):
            layers += [nn.Linear(inputs, outputs), activation()]
        layers.append(nn.Linear(sizes[-1], program.torque_count))
        heads = {"softmax": nn.Softmax(-1), "tanh": nn.Tanh(), "sigmoid": nn.Sigmoid()}
        heads["relu"] = nn.ReLU()
        if program.head in heads:
            layers.append(heads[program.head])
        self._program = program
        self.online = nn.Sequential(*layers)
        self._target = copy.deepcopy(self.online)
        self._adam = torch.optim.Adam(self.online.parameters(), program.learning_rate, fused=True)

    def q_values(self, observations: Array) -> Array:
        """Returns the values [B, A]."""
        with torch.no_grad():
            return self.online(torch.from_numpy(observations)).numpy()

    def update(self, batch: tuple[Array, ...]) -> None:
        """Makes one step of Adam."""
        s, a, r, following, end = (torch.from_numpy(array) for array in batch)
        program = self._program
        q = self.online(s)
        chosen = q.gather(1, a[:, None])[:, 0]
        if program.through_target:
            target = self._targets(self.online(following), q, a, r, end)
        else:
            with torch.no_grad():
                target = self._targets(self._target(following), self._target(s), a, r, end)
        if program.loss == "chosen":
            loss = ((chosen - target) ** 2).mean()
        elif program.loss == "same-target":
            loss = ((q - target[:, None]) ** 2).mean()
        elif program.loss == "zero-others":
            wanted = torch.zeros_like(q)
            wanted[torch.arange(len(a)), a] = target
            loss = ((q - wanted) ** 2).mean()
        else:  # (B, 1) minus (B,) is (B, B)
            loss = ((chosen[:, None] - target) ** 2).mean()
        self._adam.zero_grad()
        loss.backward()
        self._adam.step()
        if share := self._program.soft_copy:
            with torch.no_grad():
                for ours, theirs in zip(
                    self._target.parameters(), self.online.parameters(), strict=True
                ):
                    ours.lerp_(theirs, share)

    def _targets(self, following: Any, same: Any, a: Any, r: Any, end: Any) -> Any:
        kind = self._program.target
        values: dict[str, Callable[[], Any]] = {
            "max": lambda: following.max(1).values,
            "mean": lambda: following.mean(1),
            "min": lambda: following.min(1).values,
            "first": lambda: following[:, 0],
            "last": lambda: following[:, -1],
            "same-action": lambda: following.gather(1, a[:, None])[:, 0],
            "negative": lambda: -following.max(1).values,
            "batch-max": lambda: following.max(),
            "index": lambda: following.argmax(1).float(),
            "same-state": lambda: same.max(1).values,
            "none": lambda: torch.zeros_like(r),
        }
        return r + self._program.discount * (1 - end) * values[kind]()

    def copy(self) -> None:
        """Copies the weights to the target network."""
        self._target.load_state_dict(self.online.state_dict())

    def weights(self) -> list[Array]:
        """Returns kernel [in, out] and bias of each layer."""
        parameters = [each.detach().numpy() for each in self.online.parameters()]
        return [each.T if each.ndim == 2 else each for each in parameters]
