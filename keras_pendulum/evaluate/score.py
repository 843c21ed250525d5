"""The score of an agent: its returns, its regret, and the two parts of the regret."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.environments.task import Task
from keras_pendulum.optimum.known_dynamics import KnownDynamics
from keras_pendulum.optimum.solutions import solution

# What the mean return gains by torques between the 41, with a margin:
# benchmarks.learning.finer_torques.
FINER_TORQUE_GAIN = 0.002


class Fall(NamedTuple):
    """The last state of an episode from which the optimum would not have fallen."""

    seed: int  #: of the episode's start
    steps_before: int  #: from this state to the end of the episode
    observation: list[float]  #: [D]


@dataclass(frozen=True, eq=False)
class Score:
    """The undiscounted returns of whole episodes.

    >>> score = kp.evaluate_policy("cartpole", episodes=2)
    >>> score.mean_return, score.regret
    (500.0, 0.0)
    """

    task: Task  #: the task that was played
    returns: NDArray[np.float64]  #: the return of each episode, [episodes]
    optimal_returns: NDArray[np.float64]  #: the best possible ones, with 41 torques, [episodes]
    discount: float | None = None  #: γ that the policy learned with, where it is known
    seeds: range | None = None  #: the seeds of the starts
    assumption: str = ""  #: says which task was assumed, for an agent that records none
    paths: Sequence[NDArray[np.float32]] = ()  #: last observations [T, D] of terminated episodes

    @property
    def environment(self) -> str:
        """Gymnasium's name."""
        return self.task.environment

    @property
    def gravity(self) -> float | None:
        """The gravity in m/s²; None for CartPole."""
        return self.task.gravity

    @property
    def mean_return(self) -> float:
        """The mean over the starts."""
        return float(self.returns.mean())

    @property
    def std_return(self) -> float:
        """The standard deviation over the starts."""
        return float(self.returns.std())

    @property
    def median_return(self) -> float:
        """The median over the starts."""
        return float(np.median(self.returns))

    @property
    def worst_return(self) -> float:
        """The lowest return."""
        return float(self.returns.min())

    @property
    def optimal_mean_return(self) -> float:
        """The mean optimal return of the same starts."""
        return float(self.optimal_returns.mean())

    @property
    def regret(self) -> float:
        """The mean optimal return minus the mean return."""
        return self.optimal_mean_return - self.mean_return

    @cached_property
    def discount_regret(self) -> float | None:
        """The part of the regret that the discount alone costs, by the exact policy for γ.

        It is None for an unknown discount. For another γ and gravity than those of the presets, its
        first use takes about 10 s.
        """
        if self.seeds is None:
            return None
        return solution(self.task).discount_cost(self.discount, self.seeds)

    @property
    def learning_regret(self) -> float | None:
        """The regret from learning; negative where the policy beats the exact one for γ."""
        cost = self.discount_regret
        return None if cost is None else self.regret - cost

    @property
    def fallen(self) -> int:
        """The number of episodes that terminated early; 0 for the pendulum."""
        return 0 if self.task.never_terminates else int((self.returns < self.optimal_returns).sum())

    @cached_property
    def falls(self) -> list[Fall]:
        """The last state before each fall from which the optimum still balances the pole.

        Those of the first 1000 episodes. An episode whose last 100 states are all lost has none.
        """
        exact, found = solution(self.task), []
        if not isinstance(exact, KnownDynamics):
            return []
        for number, path in enumerate(self.paths):
            if not len(path) or self.seeds is None:
                continue
            balanced = exact.survives(exact.states_of(path))
            if balanced.any():
                last = int(np.flatnonzero(balanced)[-1])
                state = [float(each) for each in path[last]]
                found.append(Fall(self.seeds[number], len(path) - last, state))
        return found

    def as_json(self) -> dict[str, Any]:
        """Returns the object that `evaluate --json` prints."""
        return {
            "environment": self.environment,
            "gravity": self.gravity,
            "episodes": len(self.returns),
            "mean_return": self.mean_return,
            "std_return": self.std_return,
            "median_return": self.median_return,
            "worst_return": self.worst_return,
            "optimal_mean_return": self.optimal_mean_return,
            "regret": self.regret,
            "discount": self.discount,
            "discount_regret": self.discount_regret,
            "learning_regret": self.learning_regret,
            **({"assumption": self.assumption} if self.assumption else {}),
            **({"fallen": self.fallen} if self.fallen else {}),
            **({"falls": [fall._asdict() for fall in self.falls]} if self.falls else {}),
        }

    def summary(self) -> str:
        """Returns the lines that `evaluate` prints.

        There are three, one more for a known discount, and one more for a pole that fell.
        """
        regret = f"{self.regret:.2f}"
        if self.regret < 0:
            regret = f"0.00 (the mean return is {-self.regret:.4f} above the best known one: "
            if -self.regret <= FINER_TORQUE_GAIN:
                regret += "a torque between the 41 of the optimum can gain so much)"
            else:
                regret += (
                    f"torques between the 41 of the optimum gain at most {FINER_TORQUE_GAIN}, so "
                    "the best known one is too low for these starts; see docs/agents.md)"
                )
        lines = [
            f"Greedy on {len(self.returns)} fixed starts, {self.task.name}"
            f": mean return {self.mean_return:.2f} (standard deviation {self.std_return:.2f}, "
            f"median {self.median_return:.2f}, worst {self.worst_return:.2f})",
            *([self.assumption] if self.assumption else []),
            f"Best possible on the same starts: {self.optimal_mean_return:.2f}",
            f"Regret: {regret}",
        ]
        cost, rest = self.discount_regret, self.learning_regret
        if cost is not None and rest is not None:
            part = f"Regret from learning: {rest:.2f}"
            if rest < 0:
                part = f"This policy is better by {-rest:.2f}"
            lines.append(
                f"Exact policy for the discount {self.discount:g}: regret {cost:.2f}. {part}"
            )
        if self.fallen:
            lines.append(self._falls_line())
        return "\n".join(lines)

    def _falls_line(self) -> str:
        line = f"The pole fell in {self.fallen} of {len(self.returns)} episodes"
        if not self.falls:
            return line
        before = np.array([fall.steps_before for fall in self.falls])
        seed, _, state = self.falls[0]
        names = zip(self.task.observation_names, state, strict=True)
        shown = ", ".join(f"{name} = {value:.2f}" for name, value in names)
        return (
            f"{line}. The optimum would still balance it {np.median(before):.0f} steps before the "
            f"end (median of {len(before)}): with seed {seed}, at {shown}"
        )
