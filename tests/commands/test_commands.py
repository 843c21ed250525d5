"""The commands as a user types them, with right and wrong arguments."""

from __future__ import annotations

import csv
import json
import os
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pandas
import pytest
import tensorflow as tf
from conftest import DATA, Command, Refusal
from PIL import Image, ImageSequence
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from tensorboard.plugins.hparams import plugin_data_pb2
from tensorboard.plugins.hparams.metadata import SESSION_START_INFO_TAG

import keras_pendulum as kp
from keras_pendulum.__main__ import COMMANDS
from keras_pendulum.evaluate import __main__ as evaluate
from keras_pendulum.evaluate.film import SIZE
from keras_pendulum.train import __main__ as train
from keras_pendulum.train.checkpoint import CheckpointWriter, load_checkpoint
from keras_pendulum.train.progress import Progress
from keras_pendulum.train.run import Run

RECORDED = DATA / "pendulum_weight.keras2.h5"


# Prints the help of a command, and fails where that imports a package that takes long.
HELP = """
import runpy, sys
name = sys.argv.pop()
sys.argv.append("--help")
try:
    runpy.run_module(name, run_name="__main__", alter_sys=True)
except SystemExit as exit:
    assert exit.code == 0
heavy = {"tensorflow", "keras", "gymnasium", "matplotlib", "h5py", "numpy", "pygame", "scipy"}
found = {*heavy, "distributed"} & set(sys.modules)
assert not found, found
"""


@pytest.mark.parametrize("name", ["", *(f".{name}" for name in COMMANDS)])
def test_help_is_printed_in_ascii_and_imports_no_heavy_package(name: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", HELP, f"keras_pendulum{name}"],
        env={**os.environ, "PYTHONIOENCODING": "ascii"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert f"usage: python -m keras_pendulum{name} " in done.stdout


def test_train_prints_one_line_per_episode_and_the_score(
    in_process: Command, tmp_path: Path
) -> None:
    done = in_process("train", "--episodes", "3", "--seed", "4", "--hidden-units", "16,8")
    assert (done.returncode, done.stderr) == (0, "")
    lines = done.stdout.splitlines()
    assert [line.split(",")[0] for line in lines[:3]] == [f"Episode: {i}" for i in range(3)]
    assert "best possible" in done.stdout.lower()
    assert "Greedy on 100 fixed starts" in done.stdout
    assert "Regret: " in done.stdout
    assert "random actions on the same starts: -920.87" in done.stdout
    folder = tmp_path / "runs" / "reference-seed4"
    assert (folder / "pendulum_weight.h5").exists()
    assert kp.load_weights(folder / "pendulum_weight.h5").hidden_units == (16, 8)

    longer = in_process("train", "--resume", "--seed", "4", "--episodes", "5")
    assert longer.returncode == 0, longer.stderr
    assert longer.stdout.startswith("Episode: 3,")


# The first update comes in the second episode.
SHORT = ["--preset", "original", "--hidden-units", "8", "--warmup-episodes", "1", "--out", "run"]


def test_quiet_run_prints_the_closing_lines_and_pandas_reads_its_history(
    in_process: Command, tmp_path: Path
) -> None:
    done = in_process("train", *SHORT, "--episodes", "3", "--quiet")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("Trained 3 episodes")
    assert "Regret: " in done.stdout
    table = pandas.read_csv(tmp_path / "run" / "history.csv")
    assert list(table.episode) == [0, 1, 2]
    assert table.episode_return.between(-2000, 0).all()
    assert table.loss.isna().tolist() == [True, False, False]
    assert {kind.kind for kind in table.dtypes} == {"i", "f"}


def test_tensorboard_shows_curves_and_phase_planes(
    in_process: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("keras_pendulum.train.tensorboard._EPISODES_BETWEEN_PLANES", 4)
    words = [*SHORT, "--tensorboard", "--save-every", "2"]
    for episodes, more in ((3, ["--evaluate-every", "2"]), (6, ["--resume"])):
        done = in_process("train", *words, "--episodes", str(episodes), *more)
        assert done.returncode == 0, done.stderr
    events = EventAccumulator(str(tmp_path / "run" / "tensorboard"), {"tensors": 0})
    events.Reload()
    with open(tmp_path / "run" / "history.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    for name, column in (
        ("rollout/return", "episode_return"),
        ("rollout/epsilon", "epsilon"),
        ("rollout/environment_steps", "environment_steps"),
        ("train/loss", "loss"),
        ("train/updates", "updates"),
        ("eval/greedy_regret", "greedy_regret"),
    ):
        logged = {
            event.step: float(tf.make_ndarray(event.tensor_proto)) for event in events.Tensors(name)
        }
        wanted = {int(row["episode"]): float(row[column]) for row in rows if row[column]}
        assert logged == pytest.approx(wanted, rel=1e-6)
    settings = plugin_data_pb2.HParamsPluginData.FromString(
        events.SummaryMetadata(SESSION_START_INFO_TAG).plugin_data.content
    ).session_start_info.hparams
    assert settings["preset"].string_value == "original"
    assert settings["hidden_units"].string_value == "8"
    assert settings["learning_rate"].number_value == 1e-3
    maps = {event.step: event.tensor_proto.string_val for event in events.Tensors("phase plane")}
    assert list(maps) == [0, 2, 4, 5]
    assert tf.io.decode_png(maps[5][2]).shape == (690, 960, 4)


def test_printed_commands_run(in_process: Command) -> None:
    words = ["--preset", "original", "--hidden-units", "8", "--episodes", "1", "--out=-my run"]
    lines = in_process("train", *words).stdout.splitlines()
    commands = [line.split(": ", 1)[1] for line in lines if ": python -m " in line]
    assert len(commands) == 3
    evaluate_words = shlex.split(commands[0])[3:]
    assert evaluate_words[-1] == "--render"
    assert in_process("evaluate", *evaluate_words[:-1]).returncode == 0
    assert [shlex.split(command)[-1] for command in commands[1:]] == [evaluate_words[0]] * 2


def test_missing_tensorboard_is_one_error_line(
    refusal: Refusal, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    line = refusal(train.main, ["--tensorboard", "--out", "run"])
    assert line == "error: tensorboard is not installed: pip install tensorboard\n"


def test_evaluate_prints_the_score_of_evaluate_policy(in_process: Command) -> None:
    words = ["evaluate", "reference", "--episodes", "4", "--seed", "3", "--gravity", "10", "--json"]
    done = in_process(*words)
    assert (done.returncode, done.stderr) == (0, "")
    path = kp.find_weights("reference")
    score = kp.evaluate_policy(kp.load_weights(path), 4, 3, gravity=10)
    assert json.loads(done.stdout) == {"weights": str(path), **score.as_json()}
    assert in_process(*words[:-1]).stdout == f"{score.summary()}\n"


@pytest.fixture
def pole(tmp_path: Path) -> Path:
    """A network of CartPole with short episodes."""
    network = kp.DQN((8,), 2, observation_size=4, metadata={"environment": "CartPole-v1"})
    path = tmp_path / "pole.h5"
    kp.save_weights(network, path)
    return path


def test_gif_has_the_shape_and_speed_of_the_environment(
    in_process: Command, pole: Path, tmp_path: Path
) -> None:
    words = ["evaluate", pole, "--episodes", "1", "--gif"]
    assert in_process(*words, "film.gif").returncode == 0
    steps = int(kp.evaluate_policy(pole, 1).mean_return)
    with Image.open(tmp_path / "film.gif") as film:
        assert film.size == SIZE
        shown = [frame.info["duration"] for frame in ImageSequence.Iterator(film)]
    assert shown == [5 * 20] * (steps // 5 + 1)  # ms; each fifth step, and the last one
    done = in_process(*words, "no/such/folder.gif")
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert done.stderr.startswith("error: cannot write no")


@pytest.mark.parametrize("driver", ["dummy", ""])
def test_render_works_with_a_dummy_display_and_needs_one(
    driver: str, in_process: Command, pole: Path
) -> None:
    display = {"DISPLAY": "", "WAYLAND_DISPLAY": "", "SDL_VIDEODRIVER": driver}
    words = ["evaluate", pole, "--episodes", "1", "--render"]
    done = in_process(*words, environment=display)
    if driver:
        assert done.returncode == 0, done.stderr
    else:
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr == "error: there is no display to open a window on\n"


# What each value may be is tested in config/ and evaluate/.
WRONG = [
    (["train", "--preset", "cart-pole"], "did you mean cartpole?"),
    (["train", "--epsiodes", "5"], "--epsiodes 5; did you mean --episodes?"),
    (["evaluate", "reference", "--jsn"], "unrecognized arguments: --jsn; did you mean --json?"),
    (["train", "--episodes", "-5"], "episodes is -5"),
    (["train", "--keep-best"], "keep_best true has no effect with evaluate_every 0: leave it out"),
    (["train", "--resume", "--overwrite"], "not allowed with"),
    (
        ["train", "--resume"],
        "reference-seed0: no such folder; expected the folder of a run; leave out --resume to "
        "start a run, or name the folder of one with --out",
    ),
    (["train", "--resume", "--init", "text.h5"], "give only one of them"),
    (["train", "--out", ""], "the name is empty"),
    (["train", "--preset", ""], "the name is empty"),
    (["train", "--out", "n" * 300], "File name too long"),
    (["train", "--init", "missing.h5"], "missing.h5: no such file"),
    (["train", "--init", RECORDED, "--hidden-units", "8"], "hidden_units (512, 256, 128)"),
    (
        ["train", "--preset", "cartpole-original", "--init", RECORDED],
        "has observation_size 3, the settings say 4",
    ),
    (
        ["train", "--init", "cartpole"],
        "for CartPole-v1 with the activation relu, not tanh",
    ),
    (["train", "--out", "text.h5"], "cannot make the folder text.h5"),
    (["train", "--live", "--render"], "not allowed with"),
    (["evaluate"], "the following arguments are required: AGENT"),
    (["evaluate", "missing.h5"], "missing.h5: no such file"),
    (["evaluate", ""], "the name of the weights file is empty"),
    (["evaluate", "text.h5"], "text.h5: not an HDF5 file"),
    (["evaluate", "reference", "--torques", "-2,2"], "needs --torques=VALUE"),
    (["evaluate", "reference", "--gif", "no/a.gif"], "there is no folder no"),
    (["evaluate", "n" * 300], "File name too long"),
    (["evaluate", "cartpole", "--gravity", "2"], "gravity belongs to Pendulum-v1"),
    (["evaluate", "reference", "--gif", "text.h5"], "text.h5 holds something else than a GIF"),
    (["evaluate", "reference", "--gif", "n" * 300], "File name too long"),
    (["evaluate", "reference", "--gif", "film.mp4"], "expected a name that ends in .gif"),
    (["evaluate", "reference", "--video", "film.avi"], "expected a name that ends in .mp4"),
    (["evaluate", "reference", "--start", "hanging"], "--start is the start of a film"),
    (["evaluate", "reference", "--gif", "a.gif", "--start", "181"], "'181' is not a start"),
]


@pytest.mark.parametrize(("words", "message"), WRONG, ids=lambda value: str(value)[:60])
def test_wrong_arguments_are_one_error_line(
    words: list[str], message: str, refusal: Refusal
) -> None:
    main = {"train": train.main, "evaluate": evaluate.main}[words[0]]
    assert message in refusal(main, words[1:])


@pytest.mark.parametrize(
    "words", [["train"], ["evaluate", str(RECORDED)]], ids=["train", "evaluate"]
)
def test_other_keras_backend_is_one_error_line(words: list[str], in_process: Command) -> None:
    done = in_process(*words, environment={"KERAS_BACKEND": "torch"})
    assert done.returncode == 2
    assert done.stderr == (
        "error: KERAS_BACKEND is 'torch', but this package runs on TensorFlow: unset it\n"
    )


def test_public_names_exist_and_dir_lists_them() -> None:
    assert all(getattr(kp, name) is not None for name in kp.__all__)
    assert dir(kp) == sorted(kp.__all__)
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        kp.nonsense  # noqa: B018


def test_first_control_c_stops_after_the_episode_and_second_at_once() -> None:
    with train._Interrupt() as interrupt:
        signal.raise_signal(signal.SIGINT)
        assert interrupt.asked
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)


def test_sigint_stops_a_run_in_the_background() -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with train._Interrupt() as interrupt:
            signal.raise_signal(signal.SIGINT)
        assert interrupt.asked
        assert signal.getsignal(signal.SIGINT) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


def test_control_c_after_the_last_episode_loses_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    save = CheckpointWriter.save

    def interrupted(writer: CheckpointWriter, run: Run) -> None:
        if len(run.history) == 5:
            signal.raise_signal(signal.SIGINT)
        save(writer, run)

    monkeypatch.setattr(CheckpointWriter, "save", interrupted)
    words = ["--preset", "original", "--hidden-units", "8", "--episodes", "5", "--quiet"]
    assert train.main([*words, "--out", str(tmp_path)]) == 130
    shown = capsys.readouterr().out
    assert "Trained 5 episodes" in shown
    assert "Regret: " in shown
    config = kp.preset("original", hidden_units=(8,), episodes=5)
    assert len(load_checkpoint(tmp_path / "pendulum_weight.h5", config).history) == 5
    assert (tmp_path / "rewards.png").exists()


def test_progress_line_ends_before_an_error(
    in_process: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Bar(Progress):
        def end(self) -> None:
            print("the line has ended")

    def diverge(*settings: object, **options: object) -> None:
        raise kp.UserError("learning has diverged")

    monkeypatch.setattr(train, "make_progress", lambda config, quiet: Bar(config))
    monkeypatch.setattr("keras_pendulum.train.train_dqn.train_dqn", diverge)
    done = in_process("train")
    assert (done.returncode, done.stdout) == (2, "the line has ended\n")
    assert done.stderr == "error: learning has diverged\n"
