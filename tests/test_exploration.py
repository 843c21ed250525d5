from __future__ import annotations

import pytest

from keras_pendulum.exploration import EpsilonByEpisodes, EpsilonBySteps


def test_epsilon_falls_before_the_first_episode_as_in_the_original() -> None:
    epsilon = EpsilonByEpisodes(0.9, 0.99, 0.01)
    assert epsilon(0, 0) == pytest.approx(0.891)
    assert epsilon(1, 0) == pytest.approx(0.88209)


def test_epsilon_stays_at_its_floor() -> None:
    epsilon = EpsilonByEpisodes(0.9, 0.99, 0.01)
    assert epsilon(446, 0) > 0.01
    assert epsilon(447, 0) == 0.01
    assert epsilon(100_000, 0) == 0.01


def test_epsilon_falls_exponentially_with_the_steps_in_the_notebooks() -> None:
    epsilon = EpsilonBySteps(0.9, 1000, 0.05)
    assert epsilon(0, 0) == 0.9
    assert epsilon(7, 1000) == pytest.approx(0.05 + 0.85 / 2.718281828)
    assert epsilon(0, 10_000_000) == 0.05
