"""The score of an agent: its returns, its regret, and the two parts of the regret."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.environments.tasks import TASKS
from keras_pendulum.optimum.discounted import discount_cost

# What the mean return gains by torques between the 41, with a margin: benchmarks.finer_torques.
FINER_TORQUE_GAIN = 0.002


@dataclass(frozen=True)
class Score:
    """The undiscounted returns of whole episodes."""

    environment: str  #: Gymnasium's name
    gravity: float | None  #: m/s²; None for CartPole
    returns: NDArray[np.float64]  #: [episodes]
    optimal_returns: NDArray[np.float64]  #: [episodes]; with 41 torques; 500 for CartPole
    discount: float | None = None  #: γ that the policy learned with, where it is known
    seeds: range | None = None  #: of the starts

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

    @property
    def discount_regret(self) -> float | None:
        """The part of the regret that the discount alone costs, by the exact policy for γ.

        It is None for an unknown discount and for CartPole. For another γ and gravity than those
        of the presets, its first use takes about 10 s.
        """
        if self.discount is None or self.seeds is None or self.gravity is None:
            return None
        return discount_cost(self.gravity, self.discount, self.seeds)

    @property
    def learning_regret(self) -> float | None:
        """The rest of the regret; negative where the policy is better than the exact one for γ."""
        cost = self.discount_regret
        return None if cost is None else self.regret - cost

    def as_json(self) -> dict[str, Any]:
        """Returns the object that `evaluate --json` prints."""
        # Programs that read this object expect null for CartPole in the last five.
        pendulum = TASKS[self.environment].has_torque
        return {
            "environment": self.environment,
            "gravity": self.gravity,
            "episodes": len(self.returns),
            "mean_return": self.mean_return,
            "std_return": self.std_return,
            "median_return": self.median_return,
            "worst_return": self.worst_return,
            "optimal_mean_return": self.optimal_mean_return if pendulum else None,
            "regret": self.regret if pendulum else None,
            "discount": self.discount if pendulum else None,
            "discount_regret": self.discount_regret,
            "learning_regret": self.learning_regret,
        }

    def summary(self) -> str:
        """Returns the lines that `evaluate` prints: three, and a fourth for a known discount."""
        gravity = "" if self.gravity is None else f", g = {self.gravity:g}"
        lines = [
            f"Greedy on {len(self.returns)} fixed starts, {self.environment}{gravity}"
            f": mean return {self.mean_return:.2f} (standard deviation {self.std_return:.2f}, "
            f"median {self.median_return:.2f}, worst {self.worst_return:.2f})",
            f"Best possible on the same starts: {self.optimal_mean_return:.2f}",
            f"Regret: {self.regret:.2f}",
        ]
        if self.regret < 0:
            lines[-1] = f"Regret: 0.00 ({self._above_optimum()})"
        return "\n".join([*lines, *self._parts()])

    def _parts(self) -> list[str]:
        """Returns the line with the two parts of the regret, if the discount is known."""
        cost, rest = self.discount_regret, self.learning_regret
        if cost is None or rest is None:
            return []
        discount = f"Exact policy for the discount {self.discount:g}: regret {cost:.2f}"
        if rest < 0:
            return [f"{discount}; this policy is better by {-rest:.2f}"]
        return [f"{discount}; the other {rest:.2f} are left to learning"]

    def _above_optimum(self) -> str:
        """Returns why the mean return is above the best one, which is known for 41 torques."""
        excess = f"the mean return is {-self.regret:.4f} above the best known one"
        if -self.regret <= FINER_TORQUE_GAIN:
            return f"{excess}: a torque between the 41 of the optimum can gain so much"
        return (
            f"{excess}: torques between the 41 of the optimum gain at most {FINER_TORQUE_GAIN}, so "
            "the best known one is too low for these starts; see docs/agents.md"
        )
