"""Training as a function: equal runs for equal seeds, its listeners, and its options."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import keras
import numpy as np
import pytest
from conftest import assert_same
from gymnasium.wrappers import TimeLimit
from short_runs import SHORT

import keras_pendulum as kp
from keras_pendulum.dqn.agent import Agent
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.train.checkpoint import load_checkpoint

CONFIG = kp.preset("original", episodes=3, **SHORT)


def test_equal_seeds_give_runs_that_are_equal_bit_for_bit() -> None:
    # Other presets: test_checkpoint.py and test_kills.py compare two runs of each.
    config = kp.preset("swingup", episodes=12, warmup_episodes=9, hidden_units=(8,))
    first = kp.train_dqn(config)
    assert first.history[-1].updates > 0
    assert_same(kp.train_dqn(config), first)


@pytest.mark.parametrize("name", ["reference", "cartpole-original"])
def test_run_is_the_same_where_the_users_keras_computes_in_float64(name: str) -> None:
    settings = SHORT if name == "reference" else {"hidden_units": (8,)}
    config = kp.preset(name, episodes=12, **settings)
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
    # A generator, which can be read only once.
    result = kp.train_dqn(CONFIG, listeners=(each.append for each in received))
    assert received == [result.history, result.history]


@pytest.mark.parametrize(("stop_after", "finished"), [(1, False), (3, True)])
def test_should_stop_ends_the_run_after_an_episode(
    stop_after: int, finished: bool, short_ending: None, tmp_path: Path
) -> None:
    records: list[EpisodeRecord] = []
    result = kp.train_dqn(
        CONFIG,
        tmp_path,
        listeners=[records.append],
        should_stop=lambda: len(records) == stop_after,
    )
    assert (len(result.history), result.finished) == (stop_after, finished)
    assert (tmp_path / "rewards.png").exists() == finished
    if finished:
        assert result.score is not None
        assert result.score.regret == kp.evaluate_policy(result.network, 2).regret
    else:
        assert result.score is None
    assert len(load_checkpoint(tmp_path / "pendulum_weight.h5", CONFIG).history) == stop_after


def test_environment_is_closed_however_the_run_ends(
    short_ending: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    closed: list[Any] = []
    monkeypatch.setattr(TimeLimit, "close", lambda env: closed.append(env))

    def fail(record: object) -> None:
        raise ZeroDivisionError

    longer = replace(CONFIG, episodes=4)
    kp.train_dqn(CONFIG, tmp_path)
    assert len(closed) == 2  # that of the run, and that of the evaluation after it
    for options in ({"overwrite": True}, {"resume": True}):
        closed.clear()
        with pytest.raises(ZeroDivisionError):
            kp.train_dqn(longer, tmp_path, listeners=[fail], **options)  # type: ignore[arg-type]
        assert len(closed) == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"resume": True, "init": kp.DQN((8,))}, "init and overwrite start a new one"),
        ({"resume": True, "overwrite": True}, "init and overwrite start a new one"),
        ({"resume": True, "out": None}, "resume needs `out`"),
        ({"out": None, "config": replace(CONFIG, snapshots=2)}, "snapshots needs `out`"),
        (
            {"out": None, "config": replace(CONFIG, evaluate_every=1, keep_best=True)},
            "keep_best needs `out`",
        ),
    ],
)
def test_options_that_exclude_each_other_are_refused(
    options: dict[str, Any], message: str, tmp_path: Path
) -> None:
    with pytest.raises(kp.UserError, match=message):
        kp.train_dqn(**{"config": CONFIG, "out": tmp_path, **options})


def test_run_that_diverges_leaves_its_last_finite_checkpoint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = replace(CONFIG, save_every=1)
    monkeypatch.setattr(Agent, "update", lambda agent, batches: np.array([np.inf]))
    with pytest.raises(kp.UserError, match=r"^episode 2, step 20: the loss is inf.*diverged"):
        kp.train_dqn(config, tmp_path)
    assert len(load_checkpoint(tmp_path / "pendulum_weight.h5", config).history) == 2


def test_init_of_another_shape_is_refused_before_a_folder_is_made(tmp_path: Path) -> None:
    with pytest.raises(kp.ConfigError, match=r"hidden_units \(8,\), the settings say \(512, 256"):
        kp.train_dqn(kp.preset("original"), tmp_path / "run", init=kp.DQN((8,)))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda each: pickle.loads(pickle.dumps(each))])
def test_result_can_be_copied_and_pickled(copied: Callable[[Any], Any]) -> None:
    result = kp.train_dqn(replace(CONFIG, episodes=2))
    again = copied(result)
    assert repr(again.history) == repr(result.history)  # NaN differs from itself
    assert again.finished
    observations = np.ones((3, 3), np.float32)
    np.testing.assert_array_equal(again.network(observations), result.network(observations))
