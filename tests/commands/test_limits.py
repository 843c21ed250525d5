"""The limits of the commands: each at its value, and one beyond."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import assert_same

import keras_pendulum as kp
from keras_pendulum.evaluate import __main__ as evaluate
from keras_pendulum.page import __main__ as page
from keras_pendulum.play import __main__ as play
from keras_pendulum.study import __main__ as study
from keras_pendulum.study.arms import own_arms, study_name
from keras_pendulum.train import __main__ as train

GREATEST_SEED = 4_294_967_295
# The first thing that each command does after it has checked its arguments.
FIRST_WORK = {
    train: "keras_pendulum.train.__main__.require_tensorflow",
    evaluate: "keras_pendulum.environments.task.Task.make_env",
    page: "keras_pendulum.page.build.solve",
    play: "keras_pendulum.play.__main__.require_display",
    study: "keras_pendulum.study.__main__.require_tensorflow",
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
    def accept(*arguments: object, **named: object) -> None:
        raise kp.UserError("accepted")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(FIRST_WORK[command], accept)
    accepted = []
    for number in numbers:
        assert command.main([*words, number]) == 2
        error = capsys.readouterr().err
        accepted.append(error == "error: accepted\n")
        assert accepted[-1] or "; expected a" in error
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
        "keras_pendulum.optimum.best_return.best_return",  # takes 20 s
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
    assert kp.load_weights(weights).metadata["seed"] == GREATEST_SEED
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


def test_arm_has_at_most_64_letters_and_the_folder_of_the_study_few_more(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def name_of(*names: str) -> str:
        return folder_of_study(list(names), monkeypatch, capsys)

    assert name_of("a" * 64) == "a" * 22
    assert "longer than 64 letters" in name_of("a" * 65)
    assert name_of("a" * 37, "b" * 35) == f"{'a' * 37}-vs-{'b' * 35}"  # 76 letters
    assert name_of("a" * 37, "b" * 36) == f"{'a' * 37}-vs-{'b' * 35}"  # one letter is cut
    # A name that ends with a dot is another one on Windows.
    assert name_of("a" * 37, f"{'b' * 34}.5") == f"{'a' * 37}-vs-{'b' * 34}"


@pytest.mark.parametrize(
    "lengths", [(1,), (8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8), (36, 37), (64, 64)]
)
def test_no_path_of_a_study_is_longer_than_200_characters(
    lengths: tuple[int, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from keras_pendulum.study import results_folder
    from keras_pendulum.study.job import Job, Reply, RunResult

    longest_seed = study._MAX_SEEDS - 1
    texts = [
        f"{chr(97 + i) * length}: original warmup_episodes={i}" for i, length in enumerate(lengths)
    ]
    arms = own_arms([], texts)
    replaced: list[str] = []
    original = os.replace

    def record(source: Path, target: Path) -> None:
        replaced.extend(os.path.relpath(path, tmp_path) for path in (source, target))
        original(source, target)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(os, "replace", record)
    monkeypatch.setattr(
        results_folder, "decode", lambda data, job: RunResult(0.0, [0.0], [], [], [])
    )
    folder = results_folder.ResultsFolder(Path("studies") / study_name(arms), arms, 1)
    with folder.create_and_lock():
        for arm in arms:
            config = replace(arm.config, seed=longest_seed)
            job = Job(arm.name, arm.slug, config, folder.versions)
            folder.save(job, Reply(b"result", 1.0, 1.0, 2.0, "host:1"))
        folder.write("table.json", b"{}")
    assert max(map(len, replaced)) <= 200
    assert any(f"-seed{longest_seed}.json" in path for path in replaced)


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
