"""The command `compare`: its table, its figure, and the folders that it refuses."""

from __future__ import annotations

import io
from pathlib import Path

import matplotlib.image
import pytest
from conftest import Refusal

import keras_pendulum as kp
from keras_pendulum.compare import __main__ as compare
from keras_pendulum.compare.runs import short_names


def make_run(path: Path, preset: str, **settings: object) -> None:
    """Makes a run of 3 episodes and leaves its folder without a picture, as an interrupted run."""
    config = kp.preset(preset, episodes=4, hidden_units=(8, 8), **settings)
    episodes = iter(range(3))
    kp.train_dqn(config, path, should_stop=lambda: next(episodes) == 2)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Runs of two tasks, and a copy of one in a folder of the same name."""
    folder = tmp_path_factory.mktemp("runs")
    make_run(folder / "one", "original", seed=1)
    every = {"save_every": 2, "evaluate_every": 2, "keep_best": True}
    make_run(folder / "two", "reference", seed=2, discount=0.5, **every)
    make_run(folder / "pole", "cartpole-original")
    make_run(folder / "strong", "reference", gravity=10.0)
    return folder


def test_table_has_settings_and_score_of_each_run(
    runs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "figure.png"
    assert compare.main([str(runs / "two"), str(runs / "one"), "--out", str(out)]) == 0
    shown = capsys.readouterr().out.splitlines()
    scores = {
        name: kp.evaluate_policy(kp.load_weights(runs / name / "pendulum_weight.h5"))
        for name in ("one", "two")
    }
    assert shown[0] == (
        "Greedy on 100 fixed starts, Pendulum-v1, g = 1: best possible mean return "
        f"{scores['one'].optimal_mean_return:.2f}"
    )
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in shown[4:6]]
    assert rows == [
        [
            *(name, preset, seed, "3 of 4", "0"),
            *(f"{scores[name].mean_return:.2f}", f"{scores[name].regret:.2f}", changes),
        ]
        for name, preset, seed, changes in (
            ("two", "reference", "2", "hidden_units=8,8 discount=0.5"),
            ("one", "original", "1", "hidden_units=8,8"),
        )
    ]
    assert len({len(line) for line in shown[2:6]}) == 1  # aligned
    assert shown[-1] == f"Learning curves and regrets: {out}"
    picture = matplotlib.image.imread(io.BytesIO(out.read_bytes()))
    assert picture.shape[1] == 1200


def test_one_run_of_cartpole_is_compared_with_the_optimum(
    runs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for _ in range(2):  # the second time, it replaces the picture
        assert compare.main([str(runs / "pole")]) == 0
    assert "CartPole-v1: best possible mean return 500.00" in capsys.readouterr().out
    assert (tmp_path / "comparison.png").exists()


def test_runs_of_other_tasks_are_refused_by_name(runs: Path, refusal: Refusal) -> None:
    folders = [str(runs / name) for name in ("one", "pole", "two", "strong")]
    line = refusal(compare.main, folders)
    assert f"{runs / 'pole'} (CartPole-v1), {runs / 'strong'} (Pendulum-v1, g = 10): " in line
    assert f"another task than that of {runs / 'one'} (Pendulum-v1, g = 1)" in line
    assert str(runs / "two") not in line


def test_wrong_folders_and_files_are_one_error_line(runs: Path, refusal: Refusal) -> None:
    one, two = str(runs / "one"), str(runs / "two")
    for words, message in (
        ([], "the following arguments are required: RUN_FOLDER"),
        ([""], "the name is empty"),
        (["missing"], "missing: no such folder"),
        (["."], ".: holds no run (no pendulum_weight.h5 or cartpole_weight.h5)"),
        ([one, one], f"{one} and {one} are the same folder: name it once"),
        ([one, two, f"{one}/../one"], f"{one} and {one}/../one are the same folder"),
        (["text.h5"], "text.h5: a file; expected the folder of a run"),
        ([one, "--out", "text.h5"], "text.h5 holds something else than a PNG"),
        ([one, "--out", "a.jpg"], "--out is a.jpg: expected a name that ends in .png"),
        ([one, "--out", "no/such/folder.png"], "cannot write no/such/folder.png"),
        ([one, "--ot", "a.png"], "unrecognized arguments: --ot a.png; did you mean --out?"),
    ):
        assert message in refusal(compare.main, words)


def test_names_have_as_many_parents_as_make_them_different(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert short_names(["a", "b"]) == ["a", "b"]
    assert short_names(["a", "c/a"]) == [f"{tmp_path.name}/a", "c/a"]
    assert short_names(["c/a/."]) == ["a"]
    assert short_names(["/", "a"]) == ["/", "a"]
