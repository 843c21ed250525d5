"""The files of a run in its folder; files of other runs and users are not changed."""

from __future__ import annotations

import csv
import errno
import json
import os
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import matplotlib.image
import pytest

import keras_pendulum as kp
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.storage import atomic_write, run_folder
from keras_pendulum.storage.atomic_write import write_atomically
from keras_pendulum.storage.run_folder import RunFolder, find_run
from keras_pendulum.train.checkpoint import (
    CheckpointWriter,
    load_checkpoint,
    save_checkpoint,
)


def test_run_leaves_its_four_files(tmp_path: Path) -> None:
    config = kp.preset("reference", episodes=46)
    result = kp.train_dqn(config, tmp_path / "new" / "folder")
    folder = tmp_path / "new" / "folder"
    assert {file.name for file in folder.iterdir()} == {
        "pendulum_weight.h5",
        "history.csv",
        "config.json",
        "rewards.png",
    }
    settings = json.loads((folder / "config.json").read_text())
    assert kp.Config(**{**settings, "hidden_units": tuple(settings["hidden_units"])}) == config

    with open(folder / "history.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert ",".join(rows[0]) == (
        "episode,average_reward,episode_return,epsilon,loss,environment_steps,updates,seconds"
    )
    assert len(rows) == 46
    returns = [record.episode_return for record in result.history]
    assert [float(row["episode_return"]) for row in rows] == returns
    assert rows[40]["loss"] == ""
    assert float(rows[41]["loss"]) > 0
    assert (rows[-1]["environment_steps"], rows[-1]["updates"]) == ("4600", "200")

    picture = matplotlib.image.imread(folder / "rewards.png")
    assert picture.shape[0] > 300
    assert picture[..., :3].std() > 0.05  # not a blank picture


def test_checkpoints_are_written_at_episodes_0_10_20_and_at_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = kp.preset("original", episodes=24, hidden_units=(8,))
    contents: list[bytes] = []

    def write(path: Path, *parts: bytes, **options: Any) -> None:
        contents.append(b"".join(parts))
        write_atomically(path, *parts, **options)

    monkeypatch.setattr("keras_pendulum.storage.checksum.write_atomically", write)
    kp.train_dqn(config, tmp_path / "run")
    assert (tmp_path / "run" / "pendulum_weight.h5").read_bytes() == contents[-1]
    episodes = []
    for content in contents:
        (tmp_path / "one.h5").write_bytes(content)
        episodes.append(len(load_checkpoint(tmp_path / "one.h5", config).history))
    assert episodes == [0, 1, 11, 21, 24]


def full_disk(descriptor: int) -> None:
    raise OSError(28, "No space left on device")


def fill_disk_after(files: int, monkeypatch: pytest.MonkeyPatch) -> None:
    remaining = iter(range(2 * files))  # each file, and its folder
    fsync = os.fsync
    monkeypatch.setattr(
        "keras_pendulum.storage.atomic_write.os.fsync",
        lambda file: full_disk(file) if next(remaining, None) is None else fsync(file),
    )


def test_failed_checkpoint_ends_the_run_and_keeps_the_previous_checkpoint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = kp.preset("original", episodes=40, hidden_units=(8,))
    records: list[EpisodeRecord] = []
    # Three checkpoints (before the run, episodes 0 and 10), the settings and the history.
    fill_disk_after(5, monkeypatch)
    with pytest.raises(kp.UserError, match=r"cannot write .*No space left"):
        kp.train_dqn(config, tmp_path, listeners=[records.append])
    assert records[-1].episode == 29  # the checkpoint of episode 30 raises the error of 20
    monkeypatch.undo()
    assert len(load_checkpoint(tmp_path / "pendulum_weight.h5", config).history) == 11
    assert not list(tmp_path.glob(".*"))


def test_failed_last_checkpoint_raises(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fill_disk_after(4, monkeypatch)
    with pytest.raises(kp.UserError, match=r"cannot write .*pendulum_weight\.h5: No space left"):
        kp.train_dqn(kp.preset("original", episodes=2, hidden_units=(8,)), tmp_path)


def test_used_folder_is_overwritten_only_with_overwrite(tmp_path: Path) -> None:
    config = kp.preset("original", episodes=2, hidden_units=(8,))
    kp.train_dqn(config, tmp_path)
    before = {file: file.read_bytes() for file in tmp_path.iterdir()}
    with pytest.raises(kp.UserError, match=r"already holds a run.*--resume.*--overwrite"):
        kp.train_dqn(config, tmp_path)
    assert {file: file.read_bytes() for file in tmp_path.iterdir()} == before
    kp.train_dqn(kp.preset("original", episodes=3, hidden_units=(8,)), tmp_path, overwrite=True)
    assert len((tmp_path / "history.csv").read_text().splitlines()) == 4


def test_run_of_another_environment_is_removed_only_after_the_first_new_checkpoint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pendulum = kp.preset("original", episodes=2, hidden_units=(8,))
    cartpole = kp.preset("cartpole-original", episodes=2)
    kp.train_dqn(pendulum, tmp_path)
    with pytest.raises(kp.UserError, match=r"already holds a run .*pendulum_weight\.h5"):
        kp.train_dqn(cartpole, tmp_path)
    policy = (tmp_path / "pendulum_weight.h5").read_bytes()
    with monkeypatch.context() as patched:
        patched.setattr("keras_pendulum.storage.atomic_write.os.fsync", full_disk)
        with pytest.raises(kp.UserError, match="cannot write"):
            kp.train_dqn(cartpole, tmp_path, overwrite=True)
    assert (tmp_path / "pendulum_weight.h5").read_bytes() == policy
    kp.train_dqn(cartpole, tmp_path, overwrite=True)
    assert not (tmp_path / "pendulum_weight.h5").exists()
    assert find_run(tmp_path).weights.name == "cartpole_weight.h5"


def test_removed_history_is_whole_again_after_the_next_checkpoint(tmp_path: Path) -> None:
    config = kp.preset("original", episodes=12, hidden_units=(8,), save_every=5)
    history = tmp_path / "history.csv"
    lines: list[int] = []

    def remove(record: EpisodeRecord) -> None:
        if record.episode == 7:
            history.unlink()
        lines.append(len(history.read_text().splitlines()) if history.exists() else 0)

    kp.train_dqn(config, tmp_path, listeners=[remove])
    assert lines == [2, 3, 4, 5, 6, 7, 8, 0, 0, 0, 12, 13]
    assert [row["episode"] for row in csv.DictReader(history.read_text().splitlines())] == [
        str(episode) for episode in range(12)
    ]


def test_history_removed_before_the_last_checkpoint_is_whole(tmp_path: Path) -> None:
    config = kp.preset("original", episodes=3, hidden_units=(8,))
    history = tmp_path / "history.csv"
    kp.train_dqn(config, tmp_path, listeners=[lambda record: history.unlink(missing_ok=True)])
    assert len(history.read_text().splitlines()) == 4


@pytest.mark.parametrize(
    "error",
    [
        OSError(24, "Too many open files", "DejaVuSans.ttf"),
        ImportError("cannot open shared object"),
    ],
    ids=["OSError", "ImportError"],
)
def test_picture_that_cannot_be_drawn_is_drawn_by_resume(
    error: Exception, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = kp.preset("original", episodes=2, hidden_units=(8,))

    def fail(*arguments: object) -> bytes:
        raise error

    with monkeypatch.context() as patched:
        patched.setattr("keras_pendulum.figures.run_figure.draw_run", fail)
        with pytest.raises(kp.UserError, match=r"cannot draw .*rewards\.png: .*--resume draws it"):
            kp.train_dqn(config, tmp_path)
    assert len((tmp_path / "history.csv").read_text().splitlines()) == 3
    assert len(load_checkpoint(tmp_path / "pendulum_weight.h5", config).history) == 2
    kp.train_dqn(config, tmp_path, resume=True)
    assert (tmp_path / "rewards.png").exists()


def test_second_run_in_the_same_folder_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = kp.preset("original", episodes=2, hidden_units=(8,))
    # Saves without a thread, so that the folder does not change during the comparison.
    monkeypatch.setattr(
        CheckpointWriter, "save", lambda writer, run: save_checkpoint(run, writer.path)
    )

    def start_second_run(record: object) -> None:
        before = {file: file.read_bytes() for file in tmp_path.iterdir()}
        for overwrite, resume in ((True, False), (False, True), (False, False)):
            with pytest.raises(kp.UserError, match="another run is writing in"):
                kp.train_dqn(config, tmp_path, overwrite=overwrite, resume=resume)
        assert {file: file.read_bytes() for file in tmp_path.iterdir()} == before

    kp.train_dqn(config, tmp_path, listeners=[start_second_run])
    kp.train_dqn(config, tmp_path, overwrite=True)


def test_resumed_run_removes_temporary_files_of_a_killed_run(tmp_path: Path) -> None:
    config = kp.preset("original", episodes=2, hidden_units=(8,))
    kp.train_dqn(config, tmp_path)
    for name in ("pendulum_weight.h5", "cartpole_weight.h5", "history.csv", "rewards.png"):
        (tmp_path / f".{name}.0123456789abcdef.tmp").touch()
    (tmp_path / "mine.tmp").touch()
    kp.train_dqn(config, tmp_path, resume=True)
    assert [file.name for file in tmp_path.glob("*.tmp")] == ["mine.tmp"]


def test_resumed_run_renames_the_column_of_an_older_version(tmp_path: Path) -> None:
    config = kp.preset("original", episodes=2, hidden_units=(8,))
    kp.train_dqn(config, tmp_path)
    history = tmp_path / "history.csv"
    text = history.read_text(encoding="utf-8")
    older = text.replace(",episode_return,", ",return,")
    assert older != text
    history.write_text(older, encoding="utf-8")
    kp.train_dqn(config, tmp_path, resume=True)
    assert history.read_text(encoding="utf-8") == text


def test_folder_with_two_checkpoints_needs_the_environment(tmp_path: Path) -> None:
    pendulum = kp.preset("original", episodes=2, hidden_units=(8,))
    kp.train_dqn(pendulum, tmp_path)
    kp.train_dqn(kp.preset("cartpole-original", episodes=2), tmp_path / "other")
    cartpole = (tmp_path / "other" / "cartpole_weight.h5").rename(tmp_path / "cartpole_weight.h5")
    content = cartpole.read_bytes()
    with pytest.raises(kp.UserError, match=r"holds pendulum_weight\.h5 and cartpole_weight\.h5"):
        find_run(tmp_path)
    kp.train_dqn(replace(pendulum, episodes=3), tmp_path, resume=True)
    assert cartpole.read_bytes() == content


@pytest.mark.parametrize("overwrite", [False, True])
def test_other_files_in_a_folder_called_tensorboard_are_not_removed(
    overwrite: bool, tmp_path: Path
) -> None:
    (tmp_path / "tensorboard").mkdir()
    (tmp_path / "tensorboard" / "my_best.h5").write_bytes(b"a policy")
    if overwrite:
        (tmp_path / "tensorboard" / "events.out.tfevents.1.host").touch()
    config = kp.preset("original", episodes=1, hidden_units=(8,))
    kp.train_dqn(config, tmp_path, overwrite=overwrite)
    assert len(list((tmp_path / "tensorboard").iterdir())) == 1
    assert (tmp_path / "tensorboard" / "my_best.h5").read_bytes() == b"a policy"


def test_folder_with_only_tensorboard_curves_is_used(tmp_path: Path) -> None:
    (tmp_path / "tensorboard").mkdir()
    (tmp_path / "tensorboard" / "events.out.tfevents.1.host").touch()
    with pytest.raises(kp.UserError, match=r"already holds a run \(tensorboard\)"):
        kp.train_dqn(kp.preset("original", episodes=1, hidden_units=(8,)), tmp_path)


def test_folder_with_a_long_name_raises() -> None:
    with pytest.raises(kp.UserError, match=r"cannot read the folder a.*File name too long"):
        RunFolder("a" * 300, "Pendulum-v1")


def test_on_checkpoint_can_save_weights_during_the_write(tmp_path: Path) -> None:
    config = kp.preset("original", episodes=30, hidden_units=(8,), save_every=1)
    kp.train_dqn(
        config,
        tmp_path,
        on_checkpoint=lambda network, episode: kp.save_weights(network, tmp_path / f"{episode}.h5"),
    )
    assert len(list(tmp_path.glob("*[0-9].h5"))) == 30


@pytest.mark.parametrize(
    ("preset", "optimum", "random"),
    [("original", -40.69, -909), ("swingup", -131.31, -236), ("cartpole", 500, 20.6)],
)
def test_picture_shows_the_optimal_and_the_random_return(
    preset: str, optimum: float, random: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[tuple[float, float]] = []

    def draw(
        history: Any, environment: str, returns: dict[str, float], planes: Any, title: str
    ) -> bytes:
        assert title.startswith(f"{preset}, seed 0: regret ")
        drawn.append((returns["best possible"], returns["random actions"]))
        return b"a picture"

    monkeypatch.setattr("keras_pendulum.figures.run_figure.draw_run", draw)
    kp.train_dqn(kp.preset(preset, episodes=1, hidden_units=(8,)), tmp_path)
    assert (tmp_path / "rewards.png").read_bytes() == b"a picture"
    assert len(drawn) == 1
    assert drawn[0][0] == pytest.approx(optimum, abs=0.05)
    assert drawn[0][1] == pytest.approx(random, rel=0.1)


def test_files_that_windows_has_open_are_used_when_they_are_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = kp.preset("original", episodes=1)
    folder = RunFolder(tmp_path, config.environment)
    folder.start_files(config, [])
    folder.picture.touch()
    refusals = dict.fromkeys((folder.history.name, folder.picture.name), 3)
    unlink = Path.unlink

    def require_closed(path: Path) -> None:
        if refusals.get(path.name):
            refusals[path.name] -= 1
            raise PermissionError(errno.EACCES, "Permission denied")

    def open_closed(path: Path, mode: str, **options: Any) -> Any:
        require_closed(path)
        return open(path, mode, **options)

    def unlink_closed(path: Path, missing_ok: bool = False) -> None:
        require_closed(path)
        unlink(path, missing_ok)

    monkeypatch.setattr(atomic_write, "sys", SimpleNamespace(platform="win32"))
    monkeypatch.setattr(atomic_write, "time", SimpleNamespace(sleep=lambda seconds: None))
    monkeypatch.setattr(run_folder, "open", open_closed, raising=False)
    monkeypatch.setattr(Path, "unlink", unlink_closed)
    folder.append(EpisodeRecord(0, -1.0, -200.0, 0.9, 0.1, 200, 1, 0.5))
    assert folder.history.read_bytes().endswith(b"\n0,-1.0,-200.0,0.9,0.1,200,1,0.5\n")
    folder.start_files(config, [])
    assert not folder.picture.exists()
    assert set(refusals.values()) == {0}
