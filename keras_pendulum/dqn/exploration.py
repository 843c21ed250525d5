"""Schedules of ε, the probability of a random action."""

from __future__ import annotations

import math
from collections.abc import Callable

# Returns ε from the episode's index and the environment steps since the start of the run. `partial`
# makes one of each function below.
Schedule = Callable[[int, int], float]


def epsilon_by_episodes(
    start: float, decay: float, minimum: float, episode: int, steps: int
) -> float:
    """Returns ε of an episode: multiplied by `decay` before each one, down to `minimum`."""
    return max(minimum, start * decay ** (episode + 1))


def epsilon_by_steps(
    start: float, decay_steps: float, minimum: float, episode: int, steps: int
) -> float:
    """Returns ε of the next step: it falls exponentially with the steps before, to `minimum`."""
    return minimum + (start - minimum) * math.exp(-steps / decay_steps)
