"""Schedules of ε, the probability of a random action."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from keras_pendulum.config.config import Config

# Returns ε from the episode's index and the environment steps since the start of the run.
Schedule = Callable[[int, int], float]


@dataclass(frozen=True)
class EpsilonByEpisodes:
    """A schedule that multiplies ε by `decay` before each episode, down to `minimum`."""

    start: float
    decay: float
    minimum: float

    def __call__(self, episode: int, steps: int) -> float:
        """Returns ε of the episode."""
        return max(self.minimum, self.start * self.decay ** (episode + 1))


@dataclass(frozen=True)
class EpsilonBySteps:
    """A schedule in which ε falls exponentially with the environment steps to `minimum`."""

    start: float
    decay_steps: float
    minimum: float

    def __call__(self, episode: int, steps: int) -> float:
        """Returns ε of the step that follows `steps` steps."""
        return self.minimum + (self.start - self.minimum) * math.exp(-steps / self.decay_steps)


def make_schedule(config: Config) -> Schedule:
    """Returns the schedule of the settings."""
    if config.epsilon_schedule == "steps":
        return EpsilonBySteps(config.epsilon_start, config.epsilon_decay_steps, config.epsilon_min)
    return EpsilonByEpisodes(config.epsilon_start, config.epsilon_decay, config.epsilon_min)
