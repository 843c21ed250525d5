from __future__ import annotations

import csv
import itertools
import json
import os
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import matplotlib.image
import numpy as np
import pytest
from conftest import command_line
from gymnasium.wrappers import TimeLimit

import keras_pendulum as kp
from keras_pendulum.atomic_file import write_atomically
from keras_pendulum.checkpoint import (
    CheckpointWriter,
    load_checkpoint,
    load_config,
    save_checkpoint,
)
from keras_pendulum.run import Run
from keras_pendulum.run_folder import RunFolder

SHORT: dict[str, Any] = {"episodes": 46}  # learning begins at episode 41


def comparable(result: kp.TrainingResult) -> list[tuple[float, ...]]:
    """The history but for its wall-clock times."""
    return [
        tuple(-1.0 if np.isnan(value) else value for value in record[:-1])
        for record in result.history
    ]


def assert_same(ours: kp.TrainingResult, theirs: kp.TrainingResult) -> None:
    assert comparable(ours) == comparable(theirs)
    for mine, yours in zip(ours.network.get_weights(), theirs.network.get_weights(), strict=True):
        np.testing.assert_array_equal(mine, yours)


@pytest.mark.parametrize(
    "name", ["original", "walkthrough", "reference", "cartpole-original", "cartpole"]
)
def test_the_same_seed_twice_is_the_same_run_bit_for_bit(name: str) -> None:
    config = kp.preset(name, **SHORT)
    assert_same(kp.train_dqn(config), kp.train_dqn(config))


def test_another_seed_starts_from_other_weights_and_another_state() -> None:
    first, second = (Run(kp.preset("original", seed=seed, hidden_units=(8,))) for seed in (0, 1))
    assert (first.agent.online.get_weights()[0] != second.agent.online.get_weights()[0]).all()
    for run in (first, second):
        next(run.episodes())
    assert (first.replay.at([0]).observation != second.replay.at([0]).observation).all()


def test_another_seed_is_another_run() -> None:
    small = {**SHORT, "hidden_units": (8,)}
    first, second = (kp.train_dqn(kp.preset("original", seed=seed, **small)) for seed in (0, 1))
    assert comparable(first) != comparable(second)


def test_a_short_run_learns_far_better_than_chance(tmp_path: Path) -> None:
    result = kp.train_dqn(kp.preset("reference", episodes=150), tmp_path)
    score = kp.evaluate_policy(result.network, episodes=30)
    assert score.mean_return > -250  # uniformly random torque: -909
    saved = kp.evaluate_policy(kp.load_weights(tmp_path / "pendulum_weight.h5"), episodes=30)
    np.testing.assert_array_equal(saved.returns, score.returns)


def test_a_run_leaves_its_four_files(tmp_path: Path) -> None:
    config = kp.preset("reference", **SHORT)
    result = kp.train_dqn(config, tmp_path / "new" / "folder")
    folder = tmp_path / "new" / "folder"
    assert {file.name for file in folder.iterdir()} == {
        "pendulum_weight.h5",
        "history.csv",
        "config.json",
        "rewards.png",
    }
    written = json.loads((folder / "config.json").read_text())
    assert kp.Config(**{**written, "hidden_units": tuple(written["hidden_units"])}) == config

    with open(folder / "history.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert ",".join(rows[0]) == (
        "episode,average_reward,return,epsilon,loss,environment_steps,updates,seconds"
    )
    assert len(rows) == 46
    assert [float(row["return"]) for row in rows] == [r.episode_return for r in result.history]
    assert rows[40]["loss"] == ""
    assert float(rows[41]["loss"]) > 0
    assert (rows[-1]["environment_steps"], rows[-1]["updates"]) == ("9200", "110")

    picture = matplotlib.image.imread(folder / "rewards.png")
    assert picture.shape[0] > 300
    assert picture[..., :3].std() > 0.05  # something is drawn


def test_checkpoints_are_written_at_episodes_0_10_20_and_at_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = kp.preset("original", episodes=24, hidden_units=(8,))
    contents: list[bytes] = []

    def write(path: Path, *parts: bytes) -> None:
        contents.append(b"".join(parts))
        write_atomically(path, *parts)

    monkeypatch.setattr("keras_pendulum.integrity.write_atomically", write)
    kp.train_dqn(config, tmp_path / "run")
    assert (tmp_path / "run" / "pendulum_weight.h5").read_bytes() == contents[-1]
    episodes = []
    for content in contents:
        (tmp_path / "one.h5").write_bytes(content)
        episodes.append(len(load_checkpoint(tmp_path / "one.h5", config).history))
    assert episodes == [0, 1, 11, 21, 24]


def test_a_checkpoint_that_fails_beside_the_run_ends_it_and_the_last_good_one_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = kp.preset("original", episodes=40, hidden_units=(8,))
    seen: list[Any] = []
    # The checkpoints before the first episode and of episodes 0 and 10, settings and history.
    fill_disk_after(5, monkeypatch)
    with pytest.raises(kp.UserError, match=r"cannot write .*No space left"):
        kp.train_dqn(config, tmp_path, listeners=[seen.append])
    assert seen[-1].episode == 29  # the checkpoint of episode 20 failed, that of 30 is told
    monkeypatch.undo()
    assert len(load_checkpoint(tmp_path / "pendulum_weight.h5", config).history) == 11
    assert not list(tmp_path.glob(".*"))


def test_a_used_folder_is_not_overwritten_unless_asked(tmp_path: Path) -> None:
    config = kp.preset("original", episodes=2, hidden_units=(8,))
    kp.train_dqn(config, tmp_path)
    before = {file: file.read_bytes() for file in tmp_path.iterdir()}
    with pytest.raises(kp.UserError, match=r"already holds a run.*--resume.*--overwrite"):
        kp.train_dqn(config, tmp_path)
    assert {file: file.read_bytes() for file in tmp_path.iterdir()} == before
    kp.train_dqn(kp.preset("original", episodes=3, hidden_units=(8,)), tmp_path, overwrite=True)
    assert len((tmp_path / "history.csv").read_text().splitlines()) == 4


def test_a_run_of_another_environment_is_replaced_only_when_the_new_one_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pendulum = kp.preset("original", episodes=2, hidden_units=(8,))
    cartpole = kp.preset("cartpole-original", episodes=2)
    kp.train_dqn(pendulum, tmp_path)
    with pytest.raises(kp.UserError, match=r"already holds a run .*pendulum_weight\.h5"):
        kp.train_dqn(cartpole, tmp_path)
    policy = (tmp_path / "pendulum_weight.h5").read_bytes()
    with monkeypatch.context() as patched:
        patched.setattr("keras_pendulum.atomic_file.os.fsync", full_disk)
        with pytest.raises(kp.UserError, match="cannot write"):
            kp.train_dqn(cartpole, tmp_path, overwrite=True)
    assert (tmp_path / "pendulum_weight.h5").read_bytes() == policy
    kp.train_dqn(cartpole, tmp_path, overwrite=True)
    assert not (tmp_path / "pendulum_weight.h5").exists()
    assert RunFolder(tmp_path).weights.name == "cartpole_weight.h5"


def test_two_runs_do_not_share_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    config = kp.preset("original", episodes=2, hidden_units=(8,))
    # At once, for a look at the folder as it stands.
    monkeypatch.setattr(
        CheckpointWriter, "save", lambda writer, run: save_checkpoint(run, writer.path)
    )

    def another(record: object) -> None:
        before = {file: file.read_bytes() for file in tmp_path.iterdir()}
        for overwrite, resume in ((True, False), (False, True), (False, False)):
            with pytest.raises(kp.UserError, match="another run is going on in"):
                kp.train_dqn(config, tmp_path, overwrite=overwrite, resume=resume)
        assert {file: file.read_bytes() for file in tmp_path.iterdir()} == before

    kp.train_dqn(config, tmp_path, listeners=[another])
    kp.train_dqn(config, tmp_path, overwrite=True)


def test_what_a_killed_run_left_half_written_goes(tmp_path: Path) -> None:
    config = kp.preset("original", episodes=2, hidden_units=(8,))
    kp.train_dqn(config, tmp_path)
    (tmp_path / ".pendulum_weight.h5.0123456789abcdef.tmp").touch()
    (tmp_path / "mine.tmp").touch()
    kp.train_dqn(config, tmp_path, resume=True)
    assert [file.name for file in tmp_path.glob("*.tmp")] == ["mine.tmp"]


def full_disk(descriptor: int) -> None:
    raise OSError(28, "No space left on device")


def fill_disk_after(files: int, monkeypatch: pytest.MonkeyPatch) -> None:
    left = iter(range(files))
    fsync = os.fsync
    monkeypatch.setattr(
        "keras_pendulum.atomic_file.os.fsync",
        lambda file: full_disk(file) if next(left, None) is None else fsync(file),
    )


def test_a_last_checkpoint_that_fails_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fill_disk_after(4, monkeypatch)
    with pytest.raises(kp.UserError, match=r"cannot write .*pendulum_weight\.h5: No space left"):
        kp.train_dqn(kp.preset("original", episodes=2, hidden_units=(8,)), tmp_path)


def test_of_two_checkpoints_the_newer_one_goes_on(tmp_path: Path) -> None:
    for name, age in (("pendulum_weight.h5", 10), ("cartpole_weight.h5", 20)):
        (tmp_path / name).touch()
        os.utime(tmp_path / name, (age, age))
    assert RunFolder(tmp_path).weights.name == "cartpole_weight.h5"
    os.utime(tmp_path / "pendulum_weight.h5", (30, 30))
    assert RunFolder(tmp_path).weights.name == "pendulum_weight.h5"


@pytest.mark.parametrize("name", ["original", "cartpole-original"])
def test_a_stopped_and_resumed_run_ends_like_one_never_stopped(name: str, tmp_path: Path) -> None:
    # A small buffer, so that its ring has wrapped round by then.
    config = kp.preset(name, episodes=50, replay_capacity=300 if "cartpole" in name else 3000)
    whole = kp.train_dqn(config, tmp_path / "whole")
    assert whole.history[-1].environment_steps > config.replay_capacity
    for last in (5, 45):
        reached: list[int] = []

        def listen(record: Any, reached: list[int] = reached) -> None:
            reached.append(record.episode)

        def should_stop(last: int = last, reached: list[int] = reached) -> bool:
            return reached[-1] == last

        stopped = kp.train_dqn(
            config,
            tmp_path / "parts",
            resume=last > 5,
            listeners=[listen],
            should_stop=should_stop,
        )
        assert not stopped.finished
        assert stopped.history[-1].updates == whole.history[last].updates
    resumed = kp.train_dqn(config, tmp_path / "parts", resume=True)
    assert resumed.finished
    assert_same(resumed, whole)
    rows = [
        (tmp_path / part / "history.csv").read_text().splitlines() for part in ("whole", "parts")
    ]
    ours, theirs = ([line.rsplit(",", 1)[0] for line in lines] for lines in rows)
    assert ours == theirs


def test_a_finished_run_can_be_made_longer(tmp_path: Path) -> None:
    config = kp.preset("original", hidden_units=(8,), episodes=44)
    kp.train_dqn(config, tmp_path)
    longer = kp.preset("original", hidden_units=(8,), episodes=48)
    assert_same(kp.train_dqn(longer, tmp_path, resume=True), kp.train_dqn(longer))


def test_a_longer_run_of_an_annealed_rate_anneals_over_its_new_length(tmp_path: Path) -> None:
    config = kp.preset("reference", hidden_units=(8,), episodes=44)
    end = kp.train_dqn(config, tmp_path).network.get_weights()
    longer = kp.preset("reference", hidden_units=(8,), episodes=48)
    result = kp.train_dqn(longer, tmp_path, resume=True)
    assert result.history[-1].updates == longer.total_updates
    assert any(
        (ours != theirs).any()
        for ours, theirs in zip(result.network.get_weights(), end, strict=True)
    )


def test_resuming_with_other_settings_names_the_one_that_differs(tmp_path: Path) -> None:
    kp.train_dqn(kp.preset("original", episodes=2, hidden_units=(8,)), tmp_path)
    other = kp.preset("original", episodes=2, hidden_units=(8,), gravity=3.0)
    with pytest.raises(kp.ConfigError, match=r"this run has gravity 1\.0, not 3\.0"):
        kp.train_dqn(other, tmp_path, resume=True)


@pytest.mark.parametrize(
    ("preset", "best", "chance"),
    [("original", -40.69, -909), ("swingup", -135.16, -370), ("cartpole", 500, 20.6)],
)
def test_the_picture_shows_the_best_possible_above_chance(
    preset: str, best: float, chance: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[tuple[float, float]] = []

    def draw(history: Any, environment: str, returns: dict[str, float], planes: Any) -> bytes:
        assert list(returns) == ["best possible", "random actions"]
        drawn.append((returns["best possible"], returns["random actions"]))
        return b"a picture"

    monkeypatch.setattr("keras_pendulum.pictures.finished_run", draw)
    kp.train_dqn(kp.preset(preset, episodes=1, hidden_units=(8,)), tmp_path)
    assert (tmp_path / "rewards.png").read_bytes() == b"a picture"
    assert len(drawn) == 1
    assert drawn[0][0] == pytest.approx(best, abs=0.05)
    assert drawn[0][1] == pytest.approx(chance, rel=0.1)


def test_a_run_killed_in_its_first_episode_leaves_one_run_and_can_be_resumed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class KilledError(Exception):
        pass

    def kill(*parts: object) -> int:
        raise KilledError

    kp.train_dqn(kp.preset("original", seed=9, episodes=2, hidden_units=(8,)), tmp_path)
    config = kp.preset("original", episodes=3, hidden_units=(8,))
    with monkeypatch.context() as patched:
        patched.setattr("keras_pendulum.agent.Agent.select_action", kill)
        with pytest.raises(KilledError):
            kp.train_dqn(config, tmp_path, overwrite=True)
    assert not (tmp_path / "rewards.png").exists()  # it was the other run's
    assert load_config(tmp_path / "pendulum_weight.h5") == config
    assert_same(kp.train_dqn(config, tmp_path, resume=True), kp.train_dqn(config))


CHECKPOINT_DAMAGE: dict[str, Callable[[h5py.File], None]] = {
    "no state": lambda file: file["run"].__delitem__("state"),
    "no history": lambda file: file["run"].__delitem__("history"),
    "state is a group": lambda file: replaced(file, "run/state", None),
    "replay is an array": lambda file: replaced(file, "replay", np.zeros(3)),
    "one reward for all": lambda file: replaced(file, "replay/reward", np.zeros(1, np.float32)),
    "no rewards": lambda file: file["replay"].__delitem__("reward"),
    "one number as optimizer state": lambda file: replaced(
        file, "optimizer/float32", np.float32(1)
    ),
    "too few optimizer variables": lambda file: file["optimizer"].__delitem__("int64"),
    "other target": lambda file: replaced(file, "target/float32", np.zeros(402, np.float32)),
    "not JSON": lambda file: replaced(file, "run/state", np.zeros(50, np.uint8)),
    "NaN in the optimizer": lambda file: replaced(
        file, "optimizer/float32", np.full(804, np.nan, np.float32)
    ),
}


def replaced(file: h5py.File, name: str, array: Any) -> None:
    del file[name]
    if array is None:
        file.create_group(name)
    else:
        file[name] = array


@pytest.mark.parametrize("kind", CHECKPOINT_DAMAGE)
def test_a_damaged_checkpoint_is_told_in_one_line_and_left_alone(kind: str, tmp_path: Path) -> None:
    config = kp.preset("original", episodes=2, hidden_units=(8,))
    kp.train_dqn(config, tmp_path)
    with h5py.File(tmp_path / "pendulum_weight.h5", "r+") as file:
        CHECKPOINT_DAMAGE[kind](file)
    before = {file: file.read_bytes() for file in tmp_path.iterdir()}
    with pytest.raises(kp.WeightsError) as caught:
        kp.train_dqn(config, tmp_path, resume=True)
    assert "\n" not in str(caught.value)
    assert {file: file.read_bytes() for file in tmp_path.iterdir()} == before


def test_a_run_cannot_be_made_shorter_than_it_is(tmp_path: Path) -> None:
    kp.train_dqn(kp.preset("original", episodes=4, hidden_units=(8,)), tmp_path)
    before = {file: file.read_bytes() for file in tmp_path.iterdir()}
    with pytest.raises(kp.ConfigError, match="4 episodes behind it; episodes 3 cannot be its end"):
        kp.train_dqn(kp.preset("original", episodes=3, hidden_units=(8,)), tmp_path, resume=True)
    assert {file: file.read_bytes() for file in tmp_path.iterdir()} == before


def test_a_file_with_weights_alone_is_no_run_to_resume(tmp_path: Path) -> None:
    kp.save_weights(kp.DQN((8,)), tmp_path / "pendulum_weight.h5")
    with pytest.raises(kp.WeightsError, match="weights alone"):
        kp.train_dqn(kp.preset("original"), tmp_path, resume=True)


def test_a_run_that_an_older_version_saved_is_told_and_its_weights_load(tmp_path: Path) -> None:
    config = kp.preset("original", episodes=2, hidden_units=(8,))
    trained = kp.train_dqn(config, tmp_path).network
    checkpoint = tmp_path / "pendulum_weight.h5"
    with h5py.File(checkpoint, "r+") as file:
        del file["target"]
        for number, array in enumerate(trained.get_weights()):  # one array for each variable
            file[f"target/{number}"] = array
    with pytest.raises(kp.WeightsError, match=r"older version .* use --init"):
        kp.train_dqn(config, tmp_path, resume=True)
    for ours, theirs in zip(
        trained.get_weights(), kp.load_weights(checkpoint).get_weights(), strict=True
    ):
        np.testing.assert_array_equal(ours, theirs)


def test_a_checkpoint_records_the_runs_settings(tmp_path: Path) -> None:
    config = kp.preset("walkthrough", gravity=2.5, seed=9)
    save_checkpoint(Run(config), tmp_path / "a.h5")
    assert load_config(tmp_path / "a.h5") == config


def test_a_run_that_diverges_stops_and_keeps_the_last_good_checkpoint(tmp_path: Path) -> None:
    huge = kp.DQN((8,))
    huge.head.bias.assign(np.full(41, 1e25))  # its square is beyond float32
    config = kp.preset("original", episodes=60, hidden_units=(8,))
    with pytest.raises(kp.UserError, match=r"episode 41, step 200: the loss is inf.*diverged"):
        kp.train_dqn(config, tmp_path, init=huge)
    assert len(load_checkpoint(tmp_path / "pendulum_weight.h5", config).history) == 41


@pytest.mark.parametrize("name", ["original", "cartpole-original"])
@pytest.mark.parametrize("broken", ["observation", "reward"])
def test_what_is_not_finite_stops_the_run_at_its_step_and_keeps_the_last_checkpoint(
    name: str, broken: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = kp.preset(name, episodes=9, hidden_units=(8,), save_every=1)
    steps = itertools.count(1)
    step = TimeLimit.step

    def breaking(env: Any, action: Any) -> tuple[Any, ...]:
        observation, reward, *rest = step(env, action)
        if next(steps) == last:
            if broken == "reward":
                reward = float("inf")
            else:
                observation[-1] = np.nan
        return observation, reward, *rest

    whole = kp.train_dqn(config).history
    last = whole[2].environment_steps + 5  # of the run, the 5th of episode 3
    monkeypatch.setattr(TimeLimit, "step", breaking)
    with pytest.raises(kp.UserError, match=f"^episode 3, step 5: the environment gave.*{broken}"):
        kp.train_dqn(config, tmp_path)
    assert len(load_checkpoint(RunFolder(tmp_path).weights, config).history) == 3


@pytest.mark.parametrize("name", ["original", "walkthrough", "reference"])
def test_only_finite_torques_within_the_limits_reach_the_environment(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    torques = []
    step = TimeLimit.step

    def recording(env: Any, action: Any) -> Any:
        torques.append(action.copy())
        return step(env, action)

    monkeypatch.setattr(TimeLimit, "step", recording)
    network = kp.train_dqn(kp.preset(name, episodes=3, hidden_units=(8,))).network
    network.head.bias.assign(np.full(41, np.nan))  # also of values that are none
    kp.evaluate_policy(network, 1)
    sent = np.array(torques)
    assert sent.shape == (800, 1)
    assert (np.abs(sent) <= 2).all()
    assert len(np.unique(sent)) > 20


@pytest.mark.parametrize("part", ["online", "target", "optimizer"])
def test_what_is_not_finite_is_not_saved(part: str, tmp_path: Path) -> None:
    run = Run(kp.preset("reference", hidden_units=(8,)))
    save_checkpoint(run, tmp_path / "a.h5")
    before = (tmp_path / "a.h5").read_bytes()
    variables = getattr(run.agent, part).variables
    variables[-1].assign(np.full(variables[-1].shape, np.inf))
    with pytest.raises(kp.UserError, match="a weight is not finite"):
        save_checkpoint(run, tmp_path / "a.h5")
    assert (tmp_path / "a.h5").read_bytes() == before


def test_initial_weights_are_the_given_networks(tmp_path: Path) -> None:
    given = kp.DQN((8,), seed=77)
    config = kp.preset("original", hidden_units=(8,), episodes=2)
    result = kp.train_dqn(config, init=given)
    for ours, theirs in zip(result.network.get_weights(), given.get_weights(), strict=True):
        np.testing.assert_array_equal(ours, theirs)
    with pytest.raises(kp.ConfigError, match="8-41, the settings say 512-256-128-41"):
        kp.train_dqn(kp.preset("original"), init=given)


def test_control_c_saves_a_checkpoint_and_exits_130(tmp_path: Path) -> None:
    arguments = ["--preset", "original", "--seed", "5", "--out", str(tmp_path / "run")]
    with subprocess.Popen(
        command_line("train", *arguments, "--episodes", "100000"),
        cwd=tmp_path,
        env=os.environ,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        lines = []
        for line in process.stdout:
            lines.append(line)
            if line.startswith("Episode: 13,"):
                process.send_signal(signal.SIGINT)
    assert process.returncode == 130
    assert lines[-1].startswith("Go on: python -m keras_pendulum.train --resume")
    config = load_config(tmp_path / "run" / "pendulum_weight.h5")
    saved = load_checkpoint(tmp_path / "run" / "pendulum_weight.h5", config)
    printed = [line for line in lines if line.startswith("Episode: ")]
    assert [record.line() + "\n" for record in saved.history] == printed


def test_a_training_episode_has_the_steps_that_are_asked_for() -> None:
    result = kp.train_dqn(kp.preset(episodes=3, episode_steps=7, batch_size=8))
    assert [record.environment_steps for record in result.history] == [7, 14, 21]


def test_rewards_are_learned_from_at_their_scale_and_reported_as_they_are() -> None:
    plain, scaled = (Run(kp.preset(episodes=1, reward_scale=scale)) for scale in (1.0, 0.5))
    for run in (plain, scaled):
        list(run.episodes())
    np.testing.assert_allclose(
        scaled.replay.at(range(200)).reward, 0.5 * plain.replay.at(range(200)).reward
    )
    assert scaled.history[0].episode_return == plain.history[0].episode_return
