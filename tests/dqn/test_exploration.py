from __future__ import annotations

import pytest

from keras_pendulum.dqn.exploration import epsilon_by_episodes, epsilon_by_steps


@pytest.mark.parametrize(
    ("episode", "epsilon"), [(0, 0.891), (1, 0.88209), (447, 0.01), (100_000, 0.01)]
)
def test_epsilon_decays_before_the_first_episode_as_in_the_original(
    episode: int, epsilon: float
) -> None:
    assert epsilon_by_episodes(0.9, 0.99, 0.01, episode, steps=0) == pytest.approx(epsilon)
    assert epsilon_by_episodes(0.9, 0.99, 0.01, episode, steps=99) == pytest.approx(epsilon)


@pytest.mark.parametrize(
    ("steps", "epsilon"), [(0, 0.9), (1000, 0.05 + 0.85 / 2.718281828), (10_000_000, 0.05)]
)
def test_epsilon_by_steps_falls_exponentially_as_in_the_notebooks(
    steps: int, epsilon: float
) -> None:
    assert epsilon_by_steps(0.9, 1000, 0.05, 0, steps) == pytest.approx(epsilon)
    assert epsilon_by_steps(0.9, 1000, 0.05, 7, steps) == pytest.approx(epsilon)
