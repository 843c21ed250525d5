"""How ε, the share of random actions, falls during a run."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class EpsilonDecay:
    """ε falls by a factor before each episode, down to a floor."""

    start: float
    decay: float
    minimum: float

    def __call__(self, episode: int) -> float:
        """ε of the episode with this number, the first being 0."""
        return max(self.minimum, self.start * self.decay ** (episode + 1))
