"""The training of a preset in other libraries: what needs none of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import keras_pendulum as kp
from benchmarks.learning.other_libraries import (
    TrainingPendulum,
    common_settings,
    learning_rate_schedule,
)
from benchmarks.learning.reference_beside_libraries import (
    LIBRARIES,
    RESULTS,
    RUNS,
    THIS_PACKAGE,
    Training,
    main,
    regret,
    table_rows,
)
from benchmarks.pages.code_blocks import swingup_beside
from benchmarks.speed.processes import Process


@pytest.mark.parametrize("preset", RESULTS)
def test_libraries_make_as_many_updates_as_the_preset(preset: str) -> None:
    config = kp.preset(preset)
    settings = common_settings(config)
    (steps, unit), updates = settings["train_freq"], settings["gradient_steps"]
    assert unit == "step"
    assert config.max_episode_steps % steps == 0
    assert updates * (config.max_episode_steps // steps) == config.updates_per_episode
    assert (1 - config.tau) ** updates == pytest.approx(1 - settings["tau"])


@pytest.mark.parametrize("preset", RESULTS)
def test_learning_rate_begins_and_ends_as_that_of_the_preset(preset: str) -> None:
    config = kp.preset(preset)
    rate = learning_rate_schedule(config)
    assert rate(1.0) == pytest.approx(config.learning_rate)
    assert rate(0.0) == pytest.approx(config.learning_rate_min)


def test_training_pendulum_has_the_task_and_the_scaled_rewards_of_swingup() -> None:
    config = kp.preset("swingup")
    env, plain = TrainingPendulum(config), config.task.make_env(steps=config.max_episode_steps)
    assert env.action_space.n == config.torque_count  # type: ignore[attr-defined]
    for each in (env, plain):
        each.reset(seed=3)
    truncated, steps = False, 0
    while not truncated:
        observation, reward, _, truncated, _ = env.step(40)  # the last torque, 2 N·m
        expected, expected_reward, *_ = plain.step(np.array([2.0]))
        np.testing.assert_array_equal(observation, expected)
        assert reward == pytest.approx(config.reward_scale * float(expected_reward))
        steps += 1
    assert steps == config.max_episode_steps


def test_regret_of_arrays_is_that_of_their_network_on_the_task_of_the_preset(
    tmp_path: Path,
) -> None:
    network = kp.load_weights("swingup")
    np.savez(tmp_path / "peer.npz", *network.get_weights())
    expected = kp.evaluate_policy("swingup").regret
    assert regret(tmp_path / "peer.npz", "swingup") == pytest.approx(expected)


def test_table_and_page_show_the_seeds_nearer_to_the_optimum() -> None:
    def trainings(seconds: float) -> list[Training]:
        process = Process(seconds, 300.0, "")
        return [Training(seconds - 1, process, Path("unused"))] * 3

    libraries = {THIS_PACKAGE: trainings(60.0), "stable-baselines3": trainings(240.0)}
    regrets = {THIS_PACKAGE: [4.0, 5.0, 6.0], "stable-baselines3": [7.25, 4.5, 9.0]}
    rows = table_rows(libraries, regrets)
    assert rows[1]["runs nearer to the optimum than here"] == 1
    assert rows[1]["this package's share of the process"] == 0.25
    text = swingup_beside(rows)
    for words in ("takes 60 s", "takes 240 s", "4.0, 5.0, 6.0 here", "7.25, 4.5, 9.0", "1 of 3"):
        assert words in text


def test_unknown_preset_is_refused() -> None:
    with pytest.raises(SystemExit, match="cartpole: expected one of reference, swingup"):
        main("cartpole")
    assert RESULTS.keys() == LIBRARIES.keys() == RUNS.keys()
