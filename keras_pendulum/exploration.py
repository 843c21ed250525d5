"""How ε, the share of random actions, falls during a run."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from keras_pendulum.config import Config

# ε from the episode's number, the first being 0, and the steps made since the start of the run.
Schedule = Callable[[int, int], float]


@dataclass(frozen=True)
class EpsilonByEpisodes:
    """ε falls by a factor before each episode, down to a floor."""

    start: float
    decay: float
    minimum: float

    def __call__(self, episode: int, steps: int) -> float:
        """ε in this episode."""
        return max(self.minimum, self.start * self.decay ** (episode + 1))


@dataclass(frozen=True)
class EpsilonBySteps:
    """ε falls exponentially with the steps made, towards a floor."""

    start: float
    decay_steps: float
    minimum: float

    def __call__(self, episode: int, steps: int) -> float:
        """ε of the step before which `steps` were made."""
        return self.minimum + (self.start - self.minimum) * math.exp(-steps / self.decay_steps)


def make_schedule(config: Config) -> Schedule:
    """The schedule that the settings name."""
    if config.epsilon_schedule == "steps":
        return EpsilonBySteps(config.epsilon_start, config.epsilon_decay_steps, config.epsilon_min)
    return EpsilonByEpisodes(config.epsilon_start, config.epsilon_decay, config.epsilon_min)
