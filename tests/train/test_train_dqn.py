"""Training as a function: equal runs for equal seeds, its listeners, its files, and learning."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import keras
import numpy as np
import pytest
from conftest import assert_same, comparable
from gymnasium.wrappers import TimeLimit

import keras_pendulum as kp
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.train.checkpoint import load_checkpoint

SHORT: dict[str, Any] = {"episodes": 46}  # updates begin at episode 41


@pytest.mark.parametrize(
    "name", ["original", "walkthrough", "reference", "cartpole-original", "cartpole"]
)
def test_equal_seeds_give_runs_that_are_equal_bit_for_bit(name: str) -> None:
    config = kp.preset(name, **SHORT)
    assert_same(kp.train_dqn(config), kp.train_dqn(config))


def test_another_seed_gives_another_run() -> None:
    small = {**SHORT, "hidden_units": (8,)}
    first, second = (kp.train_dqn(kp.preset("original", seed=seed, **small)) for seed in (0, 1))
    assert comparable(first) != comparable(second)


@pytest.mark.parametrize("name", ["reference", "cartpole-original"])
def test_run_is_the_same_where_the_users_keras_computes_in_float64(name: str) -> None:
    config = kp.preset(name, hidden_units=(8,), **SHORT)
    float32 = kp.train_dqn(config)
    keras.config.set_floatx("float64")
    keras.config.set_dtype_policy("float64")
    try:
        assert_same(kp.train_dqn(config), float32)
    finally:
        keras.config.set_floatx("float32")
        keras.config.set_dtype_policy("float32")


def test_listeners_get_the_record_of_each_episode() -> None:
    received: list[list[EpisodeRecord]] = [[], []]
    config = kp.preset("original", hidden_units=(8,), episodes=3)
    # A generator, which can be read only once.
    result = kp.train_dqn(config, listeners=(each.append for each in received))
    assert received == [result.history, result.history]


def test_on_checkpoint_is_called_once_for_each_checkpoint(tmp_path: Path) -> None:
    episodes: list[int] = []
    config = kp.preset("original", hidden_units=(8,), episodes=21)
    kp.train_dqn(config, tmp_path, on_checkpoint=lambda network, episode: episodes.append(episode))
    assert episodes == [0, 10, 20]


def test_on_checkpoint_is_called_for_the_last_episode(tmp_path: Path) -> None:
    calls: list[tuple[kp.DQN, int]] = []
    config = kp.preset("original", hidden_units=(8,), episodes=13)
    result = kp.train_dqn(config, tmp_path, on_checkpoint=lambda *call: calls.append(call))
    assert [episode for _, episode in calls] == [0, 10, 12]
    assert all(network is result.network for network, _ in calls)


@pytest.mark.parametrize(("stop_after", "finished"), [(1, False), (3, True)])
def test_should_stop_ends_the_run_after_an_episode(
    stop_after: int, finished: bool, tmp_path: Path
) -> None:
    records: list[EpisodeRecord] = []
    config = kp.preset("original", hidden_units=(8,), episodes=3)
    result = kp.train_dqn(
        config,
        tmp_path,
        listeners=[records.append],
        should_stop=lambda: len(records) == stop_after,
    )
    assert (len(result.history), result.finished) == (stop_after, finished)
    assert (tmp_path / "rewards.png").exists() == finished
    if finished:
        assert result.score is not None
        assert result.score.regret == kp.evaluate_policy(result.network).regret
    else:
        assert result.score is None
    assert len(load_checkpoint(tmp_path / "pendulum_weight.h5", config).history) == stop_after


def test_environment_is_closed_however_the_run_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    closed: list[Any] = []
    monkeypatch.setattr(TimeLimit, "close", lambda env: closed.append(env))

    def fail(record: object) -> None:
        raise ZeroDivisionError

    config, longer = (kp.preset("original", hidden_units=(8,), episodes=n) for n in (1, 2))
    kp.train_dqn(config, tmp_path)
    assert len(closed) == 2  # that of the run, and that of the evaluation after it
    for options in ({"overwrite": True}, {"resume": True}):
        closed.clear()
        with pytest.raises(ZeroDivisionError):
            kp.train_dqn(longer, tmp_path, listeners=[fail], **options)  # type: ignore[arg-type]
        assert len(closed) == 1


@pytest.mark.parametrize("option", ["init", "overwrite"])
def test_resume_is_refused_with_init_and_with_overwrite(option: str, tmp_path: Path) -> None:
    config = kp.preset("original", hidden_units=(8,), episodes=1)
    kp.train_dqn(config, tmp_path)
    options: dict[str, Any] = {option: kp.DQN((8,)) if option == "init" else True}
    with pytest.raises(kp.UserError, match="init and overwrite start a new one"):
        kp.train_dqn(config, tmp_path, resume=True, **options)


def test_resume_without_a_folder_is_refused() -> None:
    with pytest.raises(kp.UserError, match="resume needs `out`"):
        kp.train_dqn(kp.preset("original", episodes=1), resume=True)


def test_150_episodes_learn_far_better_than_random_actions(tmp_path: Path) -> None:
    result = kp.train_dqn(kp.preset("reference", episodes=150), tmp_path)
    score = kp.evaluate_policy(result.network, episodes=30)
    assert score.mean_return > -250  # uniformly random torque: -909
    saved = kp.evaluate_policy(kp.load_weights(tmp_path / "pendulum_weight.h5"), episodes=30)
    np.testing.assert_array_equal(saved.returns, score.returns)


def test_run_that_diverges_leaves_its_last_finite_checkpoint(tmp_path: Path) -> None:
    initial = kp.DQN((8,))
    initial.head.bias.assign(np.full(41, 1e25))  # its square is beyond float32
    config = kp.preset("original", episodes=60, hidden_units=(8,))
    with pytest.raises(kp.UserError, match=r"episode 41, step 200: the loss is inf.*diverged"):
        kp.train_dqn(config, tmp_path, init=initial)
    assert len(load_checkpoint(tmp_path / "pendulum_weight.h5", config).history) == 41


def test_run_stopped_by_the_environment_leaves_its_last_checkpoint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = kp.preset("original", episodes=9, hidden_units=(8,), save_every=1)
    steps: list[object] = []
    step = TimeLimit.step

    def breaking(env: Any, action: Any) -> tuple[Any, ...]:
        steps.append(action)
        observation, reward, *rest = step(env, action)
        return observation, float("nan") if len(steps) == 605 else reward, *rest

    monkeypatch.setattr(TimeLimit, "step", breaking)
    with pytest.raises(kp.UserError, match=r"^episode 3, step 5: "):
        kp.train_dqn(config, tmp_path)
    assert len(load_checkpoint(tmp_path / "pendulum_weight.h5", config).history) == 3


@pytest.mark.parametrize("name", ["original", "walkthrough", "reference"])
def test_environment_gets_finite_torques_within_their_limits(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    torques = []
    step = TimeLimit.step

    def recording(env: Any, action: Any) -> Any:
        torques.append(action.copy())
        return step(env, action)

    monkeypatch.setattr(TimeLimit, "step", recording)
    network = kp.train_dqn(kp.preset(name, episodes=3, hidden_units=(8,))).network
    kp.evaluate_policy(network, 1)
    taken = np.array(torques)
    assert len(taken) == 3 * kp.preset(name).max_episode_steps + 200
    assert (np.abs(taken) <= 2).all()
    assert len(np.unique(taken)) > 20


def test_init_gives_the_initial_weights() -> None:
    initial = kp.DQN((8,), seed=77)
    config = kp.preset("original", hidden_units=(8,), episodes=2)
    result = kp.train_dqn(config, init=initial)
    for ours, theirs in zip(result.network.get_weights(), initial.get_weights(), strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_init_of_another_shape_is_refused_before_a_folder_is_made(tmp_path: Path) -> None:
    with pytest.raises(kp.ConfigError, match=r"hidden_units \(8,\), the settings say \(512, 256"):
        kp.train_dqn(kp.preset("original"), tmp_path / "run", init=kp.DQN((8,)))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda each: pickle.loads(pickle.dumps(each))])
def test_result_can_be_copied_and_pickled(copied: Callable[[Any], Any]) -> None:
    result = kp.train_dqn(kp.preset("original", episodes=2, hidden_units=(8,)))
    again = copied(result)
    assert repr(again.history) == repr(result.history)  # NaN differs from itself
    assert again.finished
    observations = np.ones((3, 3), np.float32)
    np.testing.assert_array_equal(again.network(observations), result.network(observations))
