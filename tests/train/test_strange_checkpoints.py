"""A strange checkpoint is refused by all that read it, and one of an older version is read."""

from __future__ import annotations

import json
import re
import shutil
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from conftest import Refusal
from short_runs import contents

import keras_pendulum as kp
from keras_pendulum.compare import __main__ as compare
from keras_pendulum.config.settings import RENAMED
from keras_pendulum.page import __main__ as page
from keras_pendulum.storage.recorded_run import load_recorded_run
from keras_pendulum.train import checkpoint
from keras_pendulum.train.checkpoint import load_checkpoint
from keras_pendulum.train.run import make_run

CONFIG = kp.preset("original", episodes=3, hidden_units=(8,), snapshots=2, warmup_episodes=1)
FILE = "pendulum_weight.h5"
Change = Callable[[h5py.File], object]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    kp.train_dqn(CONFIG, folder)
    return folder


@pytest.fixture
def run(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return Path(shutil.copytree(folder, tmp_path_factory.mktemp("copy") / "run"))


def array(name: str, value: Any, dtype: Any = None) -> Change:
    """Returns a change of a whole array."""

    def change(file: h5py.File) -> None:
        kind = dtype or file[name].dtype
        del file[name]
        file[name] = np.asarray(value, kind)

    return change


def number(name: str, place: Any, value: Any) -> Change:
    """Returns a change of some numbers of an array."""
    return lambda file: file[name].__setitem__(place, value)


def state(**changes: Any) -> Change:
    """Returns a change of the JSON state, or of the settings in it."""

    def change(file: h5py.File) -> None:
        recorded = json.loads(file["run/state"][()].tobytes())
        for name, value in changes.items():
            (recorded if name in recorded else recorded["config"])[name] = value
        text = json.dumps(recorded)
        array("run/state", np.frombuffer(text.encode(), np.uint8))(file)

    return change


def text(content: bytes) -> Change:
    """Returns a change of the text of the JSON state."""
    return array("run/state", np.frombuffer(content, np.uint8))


def missing(name: str) -> Change:
    """Returns a change that removes an array or a group."""
    return lambda file: file.__delitem__(name)


HISTORY, EVALUATIONS = "run/history", "run/evaluations"
STRANGE: dict[str, tuple[Change, str]] = {  # and what the message says
    "no run": (missing("run"), "weights without a run to resume; use --init"),
    "no state": (missing("run/state"), "has no array run/state"),
    "no history": (missing(HISTORY), "has no array run/history"),
    "state is a group": (
        lambda file: (missing("run/state")(file), file.create_group("run/state")),
        "has no array run/state",
    ),
    "state is not JSON": (text(b"\0" * 50), "damaged"),
    "replay is an array": (array("replay", np.zeros(3), float), "damaged"),
    "history of five columns": (array(HISTORY, np.ones((3, 5))), "damaged"),
    "history of one dimension": (array(HISTORY, np.ones(8)), "damaged"),
    "history without an episode": (array(HISTORY, np.empty((0, 8))), "its history has 0 steps"),
    "return that is infinite": (number(HISTORY, (1, 2), np.inf), "1 has episode_return inf"),
    "return of 1e308": (number(HISTORY, (1, 2), 1e308), r"episode_return 1e\+308"),
    "reward that is NaN": (number(HISTORY, (2, 1), np.nan), "2 has average_reward nan"),
    "loss that is infinite": (number(HISTORY, (2, 4), np.inf), "loss inf"),
    "ε of 2": (number(HISTORY, (0, 3), 2), "epsilon 2; expected 0 to 1"),
    "half a step": (number(HISTORY, (0, 5), 0.5), "environment_steps 0.5"),
    "steps that fall": (number(HISTORY, (0, 5), 10**6), "not in order"),
    "episodes out of order": (number(HISTORY, ([0, 1, 2], 0), [1, 0, 2]), "not in order"),
    "more episodes than the run": (
        lambda file: array(HISTORY, np.repeat(file[HISTORY][()], 2, axis=0))(file),
        "it has 6 episodes; its settings say 3",
    ),
    "evaluation of no episode": (
        lambda file: file.__setitem__(EVALUATIONS, np.array([[7.0, 1.0]])),
        "evaluations are of other episodes",
    ),
    "action 50": (number("replay/action", 3, 50), "action has the size 50; expected 40"),
    "action -1": (number("replay/action", 3, -1), "action is negative"),
    "actions that are fractions": (
        lambda file: array("replay/action", file["replay/action"][()] + 0.5, "f4")(file),
        "action has the type float32; expected int32",
    ),
    "infinite observation": (number("replay/observation", (0, 0), np.inf), "NaN or infinite"),
    "huge observation": (number("replay/observation", (0, 0), 1e30), r"observation has the size 1"),
    "fewer rewards": (array("replay/reward", [0.0]), r"reward of 600 transitions has shape \(1,\)"),
    "observations of CartPole": (
        array("replay/observation", np.zeros((600, 4))),
        r"observation of 600 transitions has shape \(600, 4\)",
    ),
    "transitions of another run": (state(replay_added=5), "replay_added is 5; its history has 600"),
    "replay_added that is text": (state(replay_added="a"), "replay_added is 'a'"),
    "replay_added that is a float": (state(replay_added=600.0), r"replay_added is 600\.0"),
    "another task": (state(gravity=9.0), "its weights belong to Pendulum-v1, g = 1"),
    "layers of other settings": (
        state(hidden_units=[8192, 7000]),
        r"units; its settings say \[8192, 7000, 41\]",
    ),
    "deep JSON": (text(b'{"config":' * 90_000), "damaged"),
    "deep settings": (text(b'{"config":' + b"[" * 900 + b"]" * 900 + b"}"), ""),
    "settings of 400 digits": (state(discount=10**400), "settings that no run can have"),
    "settings that are NaN": (state(discount=float("nan")), "settings that no run can have"),
    "state of 2 MB": (text(b" " * 2**21), "run/state has 2097152 bytes; expected at most 1048576"),
    "huge weight": (number("dense/dense/bias:0", 0, 3e38), "layer dense has a weight of the size"),
}


def change_checkpoint(run: Path, change: Change) -> None:
    with h5py.File(run / FILE, "r+") as file:
        change(file)


@pytest.mark.parametrize("kind", STRANGE)
def test_strange_checkpoint_is_refused_in_one_line(kind: str, run: Path) -> None:
    change, message = STRANGE[kind]
    change_checkpoint(run, change)
    with pytest.raises(kp.WeightsError, match=rf"pendulum_weight\.h5: .*{message}") as caught:
        load_recorded_run(run / FILE)
    assert str(caught.value).isprintable()


def test_every_reader_refuses_a_strange_checkpoint(
    run: Path, folder: Path, tmp_path: Path, refusal: Refusal
) -> None:
    change_checkpoint(run, STRANGE["action 50"][0])  # what is validated last
    before = contents(run)
    expected = f"{run / FILE}: "
    with pytest.raises(kp.WeightsError, match="pendulum_weight"):
        kp.train_dqn(CONFIG, run, resume=True)
    with pytest.raises(kp.WeightsError, match="pendulum_weight"):
        kp.diagnose(run)
    assert expected in refusal(compare.main, [folder, run, "--out", tmp_path / "a.png"])
    assert expected in refusal(page.main, [run, "--out", tmp_path / "a.html"])
    assert contents(run) == before


TARGET, ITERATION = "target/dqn.head.bias", "optimizer/adam.iteration"  # bias: [41]
MOMENTUM, VELOCITY = (f"optimizer/adam.dqn_head_bias_{name}" for name in ("momentum", "velocity"))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (array(ITERATION, -1), "iteration is -1; its history has 2 updates"),
        (missing(ITERATION), "optimizer/adam/iteration is missing, unknown or of another shape"),
        (array(VELOCITY, -np.ones(41)), "velocity is negative"),
        (array(MOMENTUM, np.full(41, np.nan)), f"{MOMENTUM} holds NaN or infinite numbers"),
        (missing("target"), "head/bias is missing, unknown or of another shape"),
        (array(TARGET, np.full(41, 1e30)), r"weight of the size 1e\+30"),
        (array(TARGET, np.zeros(42)), "head/bias is missing, unknown or of another shape"),
        (number(TARGET, 0, np.inf), f"{TARGET} holds NaN or infinite numbers"),
    ],
)
def test_strange_training_state_is_refused_before_a_file_is_changed(
    change: Change, message: str, run: Path
) -> None:
    change_checkpoint(run, change)
    before = contents(run)
    with pytest.raises(kp.WeightsError, match=message) as caught:
        kp.train_dqn(CONFIG, run, resume=True)
    assert "\n" not in str(caught.value)
    assert contents(run) == before


def test_sizes_are_compared_before_a_network_is_made(
    run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    change_checkpoint(run, state(hidden_units=[8192, 7000]))
    monkeypatch.setattr(checkpoint, "make_run", None)
    config = CONFIG.change(hidden_units=(8192, 7000))
    with pytest.raises(kp.WeightsError, match="its settings say"):
        kp.train_dqn(config, run, resume=True)


def test_speeds_at_the_limit_are_diagnosed_without_a_warning(run: Path) -> None:
    change_checkpoint(run, number("replay/next_observation", ..., 8))
    with warnings.catch_warnings(action="error", category=RuntimeWarning):
        assert kp.diagnose(run).findings[0].name == "misaligned-transitions"


def test_run_without_an_episode_is_sound_and_not_compared(
    folder: Path, run: Path, refusal: Refusal
) -> None:
    shutil.rmtree(run)
    run.mkdir()
    path = run / FILE
    checkpoint.save_checkpoint(make_run(CONFIG), path)
    assert load_recorded_run(path).history == []
    assert "no finished episode yet" in refusal(compare.main, [folder, path.parent])


@pytest.mark.skipif(sys.platform == "win32", reason="needs links")
def test_link_called_tensorboard_is_not_followed(run: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.mkdir()
    (other / "events.out.tfevents.1.host").touch()
    (run / "tensorboard").symlink_to(other)
    before = (run / FILE).read_bytes()
    for resume in (False, True):
        with pytest.raises(kp.UserError, match=r"run/tensorboard is a link, .*expected a folder"):
            kp.train_dqn(CONFIG, run, overwrite=not resume, resume=resume)
    assert (other / "events.out.tfevents.1.host").exists()
    assert (run / FILE).read_bytes() == before


@pytest.mark.parametrize(
    ("name", "other"),
    [("preset", "mine"), ("gravity", 3.0), ("hidden_units", (9,)), ("gradient_clip", 100.0)],
)
def test_resuming_with_another_setting_raises_and_names_it(
    name: str, other: Any, folder: Path
) -> None:
    message = f"this run has {name} {getattr(CONFIG, name)}, not {other}: "
    with pytest.raises(kp.ConfigError, match=re.escape(message)):
        load_checkpoint(folder / FILE, CONFIG.change(**{name: other}))


def test_resumed_run_cannot_be_shorter_than_it_is(run: Path) -> None:
    before = contents(run)
    with pytest.raises(kp.ConfigError, match="has 3 episodes already; episodes is 2, expected at"):
        kp.train_dqn(CONFIG.change(episodes=2), run, resume=True)
    assert contents(run) == before


def test_settings_without_an_effect_of_an_older_version_are_not_used(run: Path) -> None:
    change_checkpoint(run, state(tau=0.5, target_period=7, keep_best=True))
    assert load_checkpoint(run / FILE, CONFIG).config == CONFIG


@pytest.mark.parametrize("name", RENAMED)
def test_checkpoint_with_an_old_setting_is_refused_and_its_weights_load(
    name: str, folder: Path, run: Path
) -> None:
    change_checkpoint(run, state(**{name: "a value"}))
    message = rf"older version .*the setting {name}\) and cannot be resumed; use --init"
    with pytest.raises(kp.WeightsError, match=message):
        kp.train_dqn(CONFIG, run, resume=True)
    weights = (kp.load_weights(each / FILE).get_weights() for each in (run, folder))
    np.testing.assert_equal(*weights)


def test_error_of_the_environment_is_not_reported_as_damage(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_window(*settings: object) -> None:
        raise RuntimeError("no window")

    monkeypatch.setattr("keras_pendulum.environments.task.Task.make_env", no_window)
    with pytest.raises(RuntimeError, match=r"^no window$"):
        load_checkpoint(folder / FILE, CONFIG)


def test_checkpoint_of_other_versions_is_resumed_with_one_warning(
    run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def change(file: h5py.File) -> None:
        attributes = file["keras_pendulum"].attrs
        versions = {**json.loads(attributes["versions"]), "keras": "3.0.0", "numpy": "2.0.0"}
        attributes["versions"] = np.bytes_(json.dumps(versions))
        attributes["version"] = np.bytes_("0.0.1")

    change_checkpoint(run, change)
    monkeypatch.setenv("TF_NUM_INTRAOP_THREADS", "7")
    with pytest.warns(UserWarning) as caught:
        load_checkpoint(run / FILE, CONFIG)
    (message,) = (str(warning.message) for warning in caught)
    assert message.startswith(
        f"{run / FILE} was saved with keras_pendulum 0.0.1, keras 3.0.0, numpy 2.0"
    )
    assert "TF_NUM_INTRAOP_THREADS 1; these differ now" in message


@pytest.mark.filterwarnings("error")
def test_checkpoint_of_the_same_versions_is_resumed_without_warning(folder: Path) -> None:
    load_checkpoint(folder / FILE, CONFIG)
