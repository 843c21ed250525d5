"""CartPole: Gymnasium's `CartPole-v1`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from keras_pendulum.environments.task import Task

if TYPE_CHECKING:
    from keras_pendulum.environments.actions import Actions


@dataclass(frozen=True)
class CartPole(Task):
    """A pole on a cart, to be balanced.

    The observation is [x in m, ẋ in m/s, θ in rad, θ̇ in rad/s], θ = 0 upright. Action 0 pushes
    left, 1 right. The reward is 1 per step until |θ| > 12° or |x| > 2.4 m terminates the episode.
    """

    environment: ClassVar[str] = "CartPole-v1"
    observation_names: ClassVar[tuple[str, ...]] = ("x", "ẋ", "θ", "θ̇")
    steps_per_episode: ClassVar[int] = 500
    never_terminates: ClassVar[bool] = False
    reward_range: ClassVar[tuple[float, float]] = (0.0, 1.0)
    seconds_per_step: ClassVar[float] = 0.02
    weights_name: ClassVar[str] = "cartpole_weight.h5"

    def actions(self, count: int | None = None) -> Actions:
        """Returns the two directions."""
        import numpy as np

        from keras_pendulum.environments.actions import Actions

        return Actions(np.arange(2))

    def action_count(self, count: int) -> int:
        """Returns 2."""
        return 2
