"""A resumed run equals a run that was never stopped."""

from __future__ import annotations

import threading
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from conftest import assert_same
from short_runs import SHORT, KilledError, kill_at_call

import keras_pendulum as kp
from keras_pendulum.dqn.agent import Agent
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.storage.recorded_run import load_recorded_run
from keras_pendulum.train.checkpoint import CheckpointWriter, load_checkpoint, save_checkpoint
from keras_pendulum.train.loop import train_episodes
from keras_pendulum.train.run import make_run

pytestmark = pytest.mark.usefixtures("short_ending")


# Those of the pendulum: test_kills.py.
@pytest.mark.parametrize("name", ["cartpole-original", "cartpole"])
def test_resumed_run_equals_an_uninterrupted_run(name: str, tmp_path: Path) -> None:
    config = kp.preset(name, hidden_units=(8,), episodes=22, replay_capacity=300)
    if config.train_frequency == "episode":
        config = config.change(warmup_episodes=8)
    uninterrupted = kp.train_dqn(config, tmp_path / "uninterrupted")
    # Old transitions are replaced during the run.
    assert uninterrupted.history[-1].environment_steps > config.replay_capacity
    records: list[EpisodeRecord] = []
    for last in (3, 17):
        stopped = kp.train_dqn(
            config,
            tmp_path / "resumed",
            resume=last > 3,
            listeners=[records.append],
            should_stop=lambda last=last: records[-1].episode == last,  # type: ignore[misc]
        )
        assert not stopped.finished
        assert not (tmp_path / "resumed" / "rewards.png").exists()
        assert stopped.history[-1].updates == uninterrupted.history[last].updates
    resumed = kp.train_dqn(config, tmp_path / "resumed", resume=True)
    assert resumed.finished
    assert (tmp_path / "resumed" / "rewards.png").exists()
    assert_same(resumed, uninterrupted)
    rows, expected = (
        [
            line.rsplit(",", 1)[0]  # without the seconds
            for line in (tmp_path / name / "history.csv").read_text().splitlines()
        ]
        for name in ("resumed", "uninterrupted")
    )
    assert rows == expected


def test_run_killed_in_its_first_episode_replaces_the_old_run_and_can_be_resumed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kp.train_dqn(kp.preset("original", seed=9, episodes=2, **SHORT), tmp_path)
    config = kp.preset("original", episodes=3, **SHORT)
    with monkeypatch.context() as patched:
        kill_at_call(Agent, "select_action", 1, patched)
        with pytest.raises(KilledError):
            kp.train_dqn(config, tmp_path, overwrite=True)
    assert not (tmp_path / "rewards.png").exists()  # the picture of the old run
    assert load_recorded_run(tmp_path / "pendulum_weight.h5").config == config
    assert_same(kp.train_dqn(config, tmp_path, resume=True), kp.train_dqn(config))


def test_extended_run_continues_from_the_averaged_weights_at_the_rate_of_the_longer_cosine(
    tmp_path: Path,
) -> None:
    config = kp.preset("reference", episodes=4, average_updates=3, **SHORT)
    averaged = kp.train_dqn(config, tmp_path).network.get_weights()
    run = load_checkpoint(tmp_path / "pendulum_weight.h5", replace(config, episodes=6))
    np.testing.assert_equal(run.agent.online.get_weights(), averaged)
    # Half of the longer run's updates are made.
    assert float(run.agent.optimizer.learning_rate) == pytest.approx(config.learning_rate / 2)


def test_checkpoint_stores_each_variable_under_its_keras_path(tmp_path: Path) -> None:
    run = make_run(kp.preset("reference", hidden_units=(8,), episodes=1, warmup_episodes=0))
    list(train_episodes(run))
    save_checkpoint(run, tmp_path / "a.h5")
    state = run.agent.get_state()
    assert state["optimizer"]["adam/iteration"] == 40
    with h5py.File(tmp_path / "a.h5") as file:
        for group in ("target", "optimizer"):
            found = {name.replace(".", "/"): array[()] for name, array in file[group].items()}
            assert found.keys() == state[group].keys()
            for name, array in found.items():
                np.testing.assert_array_equal(array, state[group][name])
                assert array.dtype == state[group][name].dtype


def test_checkpoint_written_during_the_run_holds_the_state_at_save(tmp_path: Path) -> None:
    run = make_run(kp.preset("reference", episodes=6, replay_capacity=70, **SHORT))
    episodes = train_episodes(run)
    for _ in range(4):
        next(episodes)
    save_checkpoint(run, tmp_path / "immediate.h5")
    with CheckpointWriter(tmp_path / "delayed.h5") as writer:
        run_finished = threading.Event()
        writer._thread.submit(run_finished.wait)
        writer.save(run)
        assert len(list(episodes)) == 2
        run_finished.set()
    immediate, delayed = (tmp_path / name for name in ("immediate.h5", "delayed.h5"))
    assert delayed.read_bytes() == immediate.read_bytes()


@pytest.mark.parametrize("part", ["online", "target", "optimizer"])
def test_save_checkpoint_refuses_numbers_that_are_not_finite(part: str, tmp_path: Path) -> None:
    run = make_run(kp.preset("reference", hidden_units=(8,)))
    save_checkpoint(run, tmp_path / "a.h5")
    before = (tmp_path / "a.h5").read_bytes()
    variables = getattr(run.agent, part).variables
    variables[-1].assign(np.full(variables[-1].shape, np.inf))
    with pytest.raises(kp.UserError, match="a weight is not finite"):
        save_checkpoint(run, tmp_path / "a.h5")
    assert (tmp_path / "a.h5").read_bytes() == before


def test_resume_of_a_folder_without_a_run_says_what_is_missing(tmp_path: Path) -> None:
    config = kp.preset("cartpole", hidden_units=(8,), episodes=1)
    with pytest.raises(kp.UserError, match=r"\(no pendulum_weight\.h5 or cartpole_weight\.h5\)"):
        kp.train_dqn(config, tmp_path / "missing", resume=True)
    assert not (tmp_path / "missing").exists()
    kp.save_weights(kp.DQN((8,)), tmp_path / "pendulum_weight.h5")  # of another environment
    with pytest.raises(kp.UserError, match=r"\(no cartpole_weight\.h5\): leave out --resume"):
        kp.train_dqn(config, tmp_path, resume=True)
