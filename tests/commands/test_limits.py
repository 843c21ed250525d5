"""The limits of the commands: each at its value, and one beyond."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import assert_same

import keras_pendulum as kp
from keras_pendulum.evaluate import __main__ as evaluate
from keras_pendulum.optimum import __main__ as optimum
from keras_pendulum.page import __main__ as page
from keras_pendulum.play import __main__ as play
from keras_pendulum.study import __main__ as study
from keras_pendulum.train import __main__ as train

GREATEST_SEED = 4_294_967_295
# The first thing that each command does after it has checked its arguments.
FIRST_WORK = {
    train: "keras_pendulum.train.__main__.require_tensorflow",
    evaluate: "keras_pendulum.evaluate.evaluation.greedy_policy",
    page: "keras_pendulum.page.build._fill",
    play: "keras_pendulum.play.__main__.require_display",
    study: "keras_pendulum.study.__main__.require_tensorflow",
    optimum: "keras_pendulum.optimum.optimal_return.best_return",
}
GRAVITY = ("-0.0001", "0", "100", "100.0001")
SEED = ("-1", "0", "4294967295", "4294967296")
# The words before the number, then the number below the lowest, the lowest, the highest, and the
# number above the highest.
LIMITS: list[tuple[Any, list[str], tuple[str, str, str, str]]] = [
    (train, ["--episodes"], ("0", "1", "1000000", "1000001")),
    (train, ["--seed"], SEED),
    (train, ["--gravity"], GRAVITY),
    (evaluate, ["reference", "--episodes"], ("0", "1", "1000000", "1000001")),
    (evaluate, ["reference", "--episodes", "1", "--seed"], SEED),
    # The seed of the last episode is the greatest.
    (evaluate, ["reference", "--episodes", "9", "--seed"], ("-1", "0", "4294967287", "4294967288")),
    (evaluate, ["reference", "--gravity"], GRAVITY),
    (page, ["reference", "--gravity"], GRAVITY),
    (play, ["--gravity"], GRAVITY),
    (play, ["--seed"], SEED),
    (study, ["--seeds"], ("0", "1", "100000", "100001")),
    (study, ["--workers"], ("0", "1", "512", "513")),
    (optimum, ["--out", ".", "9.81", "--steps"], ("0", "1", "200", "201")),
    (optimum, ["--out", "."], GRAVITY),
]


@pytest.mark.parametrize(("command", "words", "numbers"), LIMITS)
def test_number_at_a_limit_is_accepted_and_the_next_one_is_refused(
    command: Any,
    words: list[str],
    numbers: tuple[str, str, str, str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def accept(*arguments: object) -> None:
        raise kp.UserError("accepted")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(FIRST_WORK[command], accept)
    accepted = []
    for number in numbers:
        assert command.main([*words, number]) == 2
        error = capsys.readouterr().err
        accepted.append(error == "error: accepted\n")
        assert accepted[-1] or "; expected a" in error or "; expected 1 to 200" in error
    assert accepted == [False, True, True, False]


@pytest.mark.parametrize("preset", ["reference", "cartpole-original"])
def test_run_of_the_greatest_seed_is_saved_resumed_and_evaluated(
    preset: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(
        "keras_pendulum.optimum.optimal_return.best_return",  # takes 20 s
        lambda gravity, starts, steps: np.full(len(starts), -1.0),
    )
    config = kp.preset(preset, seed=GREATEST_SEED, episodes=44, hidden_units=(8,))
    whole = kp.train_dqn(config)
    folder = tmp_path / "run"
    stopped = kp.train_dqn(config, folder, should_stop=lambda: True)
    assert not stopped.finished
    resumed = kp.train_dqn(config, folder, resume=True)
    assert resumed.history[-1].updates > 0
    assert_same(resumed, whole)
    (weights,) = folder.glob("*.h5")
    assert kp.load_weights(weights).provenance.seed == GREATEST_SEED
    words = [str(weights), "--seed", str(GREATEST_SEED), "--episodes", "1", "--json"]
    assert evaluate.main(words) == 0
    found = json.loads(capsys.readouterr().out)["mean_return"]
    assert found == kp.evaluate_policy(whole.network, 1, GREATEST_SEED).mean_return


def folder_of_study(
    names: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> str:
    """Returns the name of the folder of a study without `--out`, or the error line."""
    folders: list[Path] = []

    def record(path: Path, *others: object) -> None:
        folders.append(path)
        raise kp.UserError("accepted")

    monkeypatch.setattr("keras_pendulum.study.results_folder.ResultsFolder", record)
    words = [word for name in names for word in ("--arm", f"{name}: reference")]
    assert study.main(words) == 2
    error = capsys.readouterr().err
    return folders[0].name if folders else error


def test_arm_has_at_most_100_letters_and_the_folder_of_the_study_too(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def name_of(*names: str) -> str:
        return folder_of_study(list(names), monkeypatch, capsys)

    assert name_of("a" * 100) == "a" * 100
    assert "longer than 100 letters" in name_of("a" * 101)
    assert name_of("a" * 47, "b" * 48) == f"{'a' * 47}-vs-{'b' * 48}"  # 99 letters
    assert name_of("a" * 48, "b" * 49) == f"{'a' * 48}-vs-{'b' * 48}"  # one letter is cut


@pytest.mark.parametrize(("count", "more"), [(5, ""), (6, "; and 1 more")])
def test_study_prints_the_reasons_of_at_most_5_failures(
    count: int,
    more: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    from keras_pendulum.study.runner import FinishedJob

    def fail(folder: Any, jobs: Any, arguments: Any) -> list[FinishedJob]:
        return [FinishedJob(job, None, "no memory") for job in jobs]

    monkeypatch.setattr(study, "_make_runs", fail)
    words = ["--presets", "reference", "--seeds", str(count), "--out", str(tmp_path / "study")]
    assert study.main(words) == 1
    (line,) = capsys.readouterr().err.splitlines()
    reasons = "; ".join(f"reference, seed {seed}: no memory" for seed in range(5))
    assert line.startswith(f"error: {count} of {count} runs failed ({reasons}{more}); run")
