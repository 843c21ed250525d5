"""The files of a run in its folder; files of other runs and users are not changed."""

from __future__ import annotations

import csv
import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from short_runs import SHORT, contents

import keras_pendulum as kp
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.storage import run_folder
from keras_pendulum.storage.atomic_write import write_atomically
from keras_pendulum.storage.run_folder import RunFolder, find_run
from keras_pendulum.train.checkpoint import CheckpointWriter, load_checkpoint, save_checkpoint

pytestmark = pytest.mark.usefixtures("short_ending")
CONFIG = kp.preset("original", episodes=2, **SHORT)


@pytest.mark.parametrize(("episodes", "last"), [(24, 24), (21, None)])
def test_checkpoints_are_written_at_episodes_0_10_20_and_at_the_end(
    episodes: int, last: int | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = replace(CONFIG, episodes=episodes)
    contents: list[bytes] = []
    calls: list[tuple[kp.DQN, int]] = []

    def write(path: Path, *parts: bytes, **options: Any) -> None:
        contents.append(b"".join(parts))
        write_atomically(path, *parts, **options)

    monkeypatch.setattr("keras_pendulum.storage.checksum.write_atomically", write)
    result = kp.train_dqn(config, tmp_path / "run", on_checkpoint=lambda *call: calls.append(call))
    assert (tmp_path / "run" / "pendulum_weight.h5").read_bytes() == contents[-1]
    saved = []
    for content in contents:
        (tmp_path / "one.h5").write_bytes(content)
        saved.append(len(load_checkpoint(tmp_path / "one.h5", config).history))
    assert saved == [0, 1, 11, 21] + [last] * (last is not None)
    assert calls == [(result.network, count - 1) for count in saved[1:]]


def fill_disk_after(files: int, monkeypatch: pytest.MonkeyPatch) -> None:
    remaining = iter(range(2 * files))  # each file, and its folder
    fsync = os.fsync

    def flush(descriptor: int) -> None:
        if next(remaining, None) is None:
            raise OSError(28, "No space left on device")
        fsync(descriptor)

    monkeypatch.setattr("keras_pendulum.storage.atomic_write.os.fsync", flush)


def test_failed_checkpoint_ends_the_run_and_keeps_the_previous_checkpoint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = replace(CONFIG, episodes=40)
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
        kp.train_dqn(CONFIG, tmp_path)


def test_used_folder_is_overwritten_only_with_overwrite(tmp_path: Path) -> None:
    kp.train_dqn(CONFIG, tmp_path)
    before = contents(tmp_path)
    with pytest.raises(kp.UserError, match=r"already holds a run.*--resume.*--overwrite"):
        kp.train_dqn(CONFIG, tmp_path)
    assert contents(tmp_path) == before
    kp.train_dqn(replace(CONFIG, episodes=3), tmp_path, overwrite=True)
    assert len((tmp_path / "history.csv").read_text().splitlines()) == 4


def test_run_of_another_environment_is_removed_only_after_the_first_new_checkpoint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cartpole = kp.preset("cartpole-original", episodes=2)
    kp.train_dqn(CONFIG, tmp_path)
    with pytest.raises(kp.UserError, match=r"already holds a run .*pendulum_weight\.h5"):
        kp.train_dqn(cartpole, tmp_path)
    policy = (tmp_path / "pendulum_weight.h5").read_bytes()
    with monkeypatch.context() as patched:
        fill_disk_after(0, patched)
        with pytest.raises(kp.UserError, match="cannot write"):
            kp.train_dqn(cartpole, tmp_path, overwrite=True)
    assert (tmp_path / "pendulum_weight.h5").read_bytes() == policy
    kp.train_dqn(cartpole, tmp_path, overwrite=True)
    assert not (tmp_path / "pendulum_weight.h5").exists()
    assert find_run(tmp_path).weights.name == "cartpole_weight.h5"


def test_removed_history_is_whole_again_after_the_next_checkpoint(tmp_path: Path) -> None:
    config = replace(CONFIG, episodes=12, save_every=5)
    history = tmp_path / "history.csv"
    lines: list[int] = []

    def remove(record: EpisodeRecord) -> None:
        if record.episode in (7, 11):
            history.unlink()
        lines.append(len(history.read_text().splitlines()) if history.exists() else 0)

    kp.train_dqn(config, tmp_path, listeners=[remove])
    assert lines == [2, 3, 4, 5, 6, 7, 8, 0, 0, 0, 12, 0]
    assert [row["episode"] for row in csv.DictReader(history.read_text().splitlines())] == [
        str(episode) for episode in range(12)
    ]


def test_picture_that_cannot_be_drawn_is_drawn_by_resume(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*arguments: object) -> bytes:
        raise ImportError("cannot open shared object")

    with monkeypatch.context() as patched:
        patched.setattr("keras_pendulum.figures.run_figure.draw_run", fail)
        with pytest.warns(UserWarning, match=r"cannot draw .*rewards\.png: .*--resume draws it"):
            result = kp.train_dqn(CONFIG, tmp_path)
    assert result.finished and result.score is not None
    assert len((tmp_path / "history.csv").read_text().splitlines()) == 3
    assert len(load_checkpoint(tmp_path / "pendulum_weight.h5", CONFIG).history) == 2
    kp.train_dqn(CONFIG, tmp_path, resume=True)
    assert (tmp_path / "rewards.png").exists()


def test_second_run_in_the_same_folder_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Saves without a thread, so that the folder does not change during the comparison.
    monkeypatch.setattr(
        CheckpointWriter, "save", lambda writer, run: save_checkpoint(run, writer.path)
    )

    def start_second_run(record: object) -> None:
        before = contents(tmp_path)
        for overwrite, resume in ((True, False), (False, True), (False, False)):
            with pytest.raises(kp.UserError, match="another run is writing in"):
                kp.train_dqn(CONFIG, tmp_path, overwrite=overwrite, resume=resume)
        assert contents(tmp_path) == before

    kp.train_dqn(CONFIG, tmp_path, listeners=[start_second_run])
    kp.train_dqn(CONFIG, tmp_path, overwrite=True)


def test_resumed_run_restores_its_folder(tmp_path: Path) -> None:
    kp.train_dqn(CONFIG, tmp_path)
    for name in ("pendulum_weight.h5", "cartpole_weight.h5", "history.csv", "rewards.png"):
        (tmp_path / f".{name}.0123456789abcdef.tmp").touch()  # as a killed run leaves it
    (tmp_path / "mine.tmp").touch()
    history = tmp_path / "history.csv"
    text = history.read_text(encoding="utf-8")
    older = text.replace(",episode_return,", ",return,")  # the column of an older version
    assert older != text
    history.write_text(older, encoding="utf-8")
    kp.train_dqn(CONFIG, tmp_path, resume=True)
    assert [file.name for file in tmp_path.glob("*.tmp")] == ["mine.tmp"]
    assert history.read_text(encoding="utf-8") == text


def test_folder_with_two_checkpoints_needs_the_environment(tmp_path: Path) -> None:
    kp.train_dqn(CONFIG, tmp_path)
    cartpole = tmp_path / "cartpole_weight.h5"
    cartpole.write_bytes(b"of another run")
    with pytest.raises(kp.UserError, match=r"holds pendulum_weight\.h5 and cartpole_weight\.h5"):
        find_run(tmp_path)
    kp.train_dqn(replace(CONFIG, episodes=3), tmp_path, resume=True)
    assert cartpole.read_bytes() == b"of another run"


@pytest.mark.parametrize("overwrite", [False, True])
def test_other_files_in_a_folder_called_tensorboard_are_not_removed(
    overwrite: bool, tmp_path: Path
) -> None:
    (tmp_path / "tensorboard").mkdir()
    (tmp_path / "tensorboard" / "my_best.h5").write_bytes(b"a policy")
    (tmp_path / "tensorboard" / "events.out.tfevents.1.folder").mkdir()
    if overwrite:
        (tmp_path / "tensorboard" / "events.out.tfevents.1.host").touch()
    kp.train_dqn(CONFIG, tmp_path, overwrite=overwrite)
    assert len(list((tmp_path / "tensorboard").iterdir())) == 2
    assert (tmp_path / "tensorboard" / "my_best.h5").read_bytes() == b"a policy"


def test_folder_with_only_tensorboard_curves_is_used(tmp_path: Path) -> None:
    (tmp_path / "tensorboard").mkdir()
    (tmp_path / "tensorboard" / "events.out.tfevents.1.host").touch()
    with pytest.raises(kp.UserError, match=r"already holds a run \(tensorboard\)"):
        kp.train_dqn(CONFIG, tmp_path)


def test_folder_with_a_long_name_raises() -> None:
    with pytest.raises(kp.UserError, match=r"cannot read the folder a.*File name too long"):
        RunFolder("a" * 300, "Pendulum-v1")


def test_picture_shows_the_optimal_and_the_random_return(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[Any] = []
    monkeypatch.setattr(
        "keras_pendulum.figures.run_figure.draw_run",
        lambda *arguments: drawn.append(arguments) or b"a picture",  # type: ignore[func-returns-value]
    )
    levels = {"best possible": -4.0, "random actions": -90.0}
    monkeypatch.setattr(
        "keras_pendulum.train.reference_returns.reference_returns", lambda config: levels
    )
    kp.train_dqn(CONFIG, tmp_path)
    assert (tmp_path / "rewards.png").read_bytes() == b"a picture"
    ((history, task, returns, _, title),) = drawn
    assert (len(history), task) == (2, CONFIG.task)
    assert returns == levels
    assert title.startswith("original, seed 0: regret ")


def test_files_are_opened_and_removed_again_while_windows_has_them_open(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = RunFolder(tmp_path, CONFIG.environment)
    folder.start_files(CONFIG, [])
    folder.picture.touch()
    retried: list[Callable[[], Any]] = []

    def retry_while_open(action: Callable[[], Any]) -> Any:
        retried.append(action)
        return action()

    monkeypatch.setattr(run_folder, "retry_while_open", retry_while_open)
    folder.append(EpisodeRecord(0, -1.0, -200.0, 0.9, 0.1, 200, 1, 0.5))
    assert len(retried) == 1
    assert folder.history.read_bytes().endswith(b"\n0,-1.0,-200.0,0.9,0.1,200,1,0.5\n")
    folder.start_files(CONFIG, [])
    assert len(retried) == 2
    assert not folder.picture.exists()


def test_best_weights_and_snapshots_of_another_run_are_removed(tmp_path: Path) -> None:
    names = [
        f"{task}_weight_{kind}.h5"
        for task in ("pendulum", "cartpole")
        for kind in ("best", "snapshots")
    ]
    for name in names:
        (tmp_path / name).touch()
        with pytest.raises(kp.UserError, match=rf"already holds a run \(.*{name}"):
            kp.train_dqn(CONFIG, tmp_path)
    kp.train_dqn(CONFIG, tmp_path, overwrite=True)
    assert not [name for name in names if (tmp_path / name).exists()]


BOTH = replace(CONFIG, evaluate_every=1, keep_best=True, snapshots=2)
BEST, SNAPSHOTS = "pendulum_weight_best.h5", "pendulum_weight_snapshots.h5"
CHANGES: dict[str, dict[str, Any]] = {
    "the run": {},
    "another seed": {"seed": 1},
    "another size": {"hidden_units": (9,)},
}


@pytest.fixture(scope="module")
def runs(short_ending: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with the folders of three runs, each with best weights and snapshots."""
    folder = tmp_path_factory.mktemp("runs")
    for name, changes in CHANGES.items():
        kp.train_dqn(replace(BOTH, **changes), folder / name)
    return folder


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        (BEST, "damaged", "not an HDF5 file"),
        (BEST, "weights alone", "not those of an evaluation of this"),
        (BEST, "another seed", "not those of an evaluation of this"),
        (SNAPSHOTS, "damaged", "not an HDF5 file"),
        (SNAPSHOTS, "weights alone", r"holds no snapshots of a run \(train --snapshots N\)"),
        (SNAPSHOTS, "another seed", "snapshots are of another run; move it to another folder"),
        (SNAPSHOTS, "another size", "its snapshots have wrong types, sizes or episodes"),
    ],
)
def test_other_file_in_place_of_best_weights_or_snapshots_stops_a_resumed_run(
    name: str, content: str, message: str, runs: Path, tmp_path: Path
) -> None:
    run = Path(shutil.copytree(runs / "the run", tmp_path / "run"))
    if content == "damaged":
        (run / name).write_bytes(b"damaged")
    elif content == "weights alone":
        kp.save_weights(kp.DQN((8,)), run / name)
    else:
        shutil.copy(runs / content / name, run / name)
    before = contents(run)
    with pytest.raises(kp.WeightsError, match=message) as caught:
        kp.train_dqn(BOTH, run, resume=True)
    assert "\n" not in str(caught.value)
    assert contents(run) == before
