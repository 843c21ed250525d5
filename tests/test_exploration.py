from __future__ import annotations

import pytest

from keras_pendulum.exploration import EpsilonDecay


def test_epsilon_falls_before_the_first_episode_as_in_the_original() -> None:
    epsilon = EpsilonDecay(0.9, 0.99, 0.01)
    assert epsilon(0) == pytest.approx(0.891)
    assert epsilon(1) == pytest.approx(0.88209)


def test_epsilon_stays_at_its_floor() -> None:
    epsilon = EpsilonDecay(0.9, 0.99, 0.01)
    assert epsilon(446) > 0.01
    assert epsilon(447) == 0.01
    assert epsilon(100_000) == 0.01
