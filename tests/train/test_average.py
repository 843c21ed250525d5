"""The moving average of the weights, in runs of every length."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import keras_pendulum as kp
from keras_pendulum.train.checkpoint import load_checkpoint
from keras_pendulum.train.run import make_run


@pytest.mark.parametrize("average_updates", [2, 1500, 1_000_000])
@pytest.mark.parametrize("episodes", [42, 60, 80, 600])
def test_average_has_forgotten_the_initial_weights_at_the_end(
    episodes: int, average_updates: int
) -> None:
    config = kp.preset("cartpole", episodes=episodes, average_updates=average_updates)
    momentum = make_run(config).agent.optimizer.ema_momentum
    assert momentum**config.total_updates < 1e-4
    assert 0 <= momentum <= 1 - 1 / average_updates


def test_run_with_fewer_updates_than_planned_keeps_its_last_weights() -> None:
    """The first updates wait for a full batch, so the average still holds the initial weights."""
    config = kp.preset("cartpole", hidden_units=(8,), episodes=70, batch_size=1000)
    runs = [kp.train_dqn(config.change(average_updates=each)) for each in (1, 1500)]
    assert 0 < runs[0].history[-1].updates < config.total_updates / 2
    np.testing.assert_equal(*(run.network.get_weights() for run in runs))


@pytest.mark.parametrize("preset", ["cartpole", "swingup"])
def test_presets_average_over_1500_updates(preset: str) -> None:
    assert kp.preset(preset).averaged_updates == kp.preset(preset).average_updates == 1500


def test_short_run_of_cartpole_learns() -> None:
    """An average with the initial weights in it holds the pole for 9 steps."""
    config = kp.preset("cartpole", episodes=60)
    assert kp.evaluate_policy(kp.train_dqn(config).network, 20).mean_return > 60


@pytest.mark.parametrize(("episodes", "restarts"), [(45, False), (46, True)])
def test_average_begins_anew_where_the_length_of_the_run_changes(
    episodes: int, restarts: bool, tmp_path: Path
) -> None:
    config = kp.preset("swingup", hidden_units=(8,), episodes=45)
    kp.train_dqn(config, tmp_path, should_stop=iter([False] * 42 + [True]).__next__)
    run = load_checkpoint(tmp_path / "pendulum_weight.h5", config.change(episodes=episodes))
    averages = [each for each in run.agent.optimizer.variables if each.path.endswith("_average")]
    same = [
        np.array_equal(average.numpy(), weight.numpy())
        for average, weight in zip(averages, run.agent.online.weights, strict=True)
    ]
    assert all(same) == restarts
