from __future__ import annotations

import pytest

import keras_pendulum as kp
from keras_pendulum.dqn.exploration import EpsilonByEpisodes, EpsilonBySteps, make_schedule


def test_epsilon_decays_before_the_first_episode_as_in_the_original() -> None:
    epsilon = EpsilonByEpisodes(0.9, 0.99, 0.01)
    assert epsilon(0, 0) == pytest.approx(0.891)
    assert epsilon(1, 0) == pytest.approx(0.88209)


def test_epsilon_by_episodes_ignores_the_steps() -> None:
    epsilon = EpsilonByEpisodes(0.9, 0.99, 0.01)
    assert epsilon(3, 0) == epsilon(3, 100_000)


def test_epsilon_by_episodes_does_not_fall_below_its_minimum() -> None:
    epsilon = EpsilonByEpisodes(0.9, 0.99, 0.01)
    assert epsilon(446, 0) > 0.01
    assert epsilon(447, 0) == 0.01
    assert epsilon(100_000, 0) == 0.01


def test_epsilon_by_steps_falls_exponentially_as_in_the_notebooks() -> None:
    epsilon = EpsilonBySteps(0.9, 1000, 0.05)
    assert epsilon(0, 0) == 0.9
    assert epsilon(7, 1000) == pytest.approx(0.05 + 0.85 / 2.718281828)
    assert epsilon(0, 10_000_000) == 0.05


def test_make_schedule_returns_the_schedule_of_the_settings() -> None:
    by_episodes = kp.preset("reference", epsilon_start=0.8, epsilon_decay=0.5, epsilon_min=0.1)
    assert make_schedule(by_episodes) == EpsilonByEpisodes(0.8, 0.5, 0.1)
    by_steps = kp.preset(
        "cartpole-original", epsilon_start=0.8, epsilon_decay_steps=7, epsilon_min=0.1
    )
    assert make_schedule(by_steps) == EpsilonBySteps(0.8, 7, 0.1)
