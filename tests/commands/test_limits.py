"""The limits of the commands: each at its value, and one beyond."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from conftest import Refusal

import keras_pendulum as kp
from keras_pendulum.evaluate import __main__ as evaluate
from keras_pendulum.page import __main__ as page
from keras_pendulum.play import __main__ as play
from keras_pendulum.study import __main__ as study
from keras_pendulum.study.arms import own_arms, study_name

GREATEST_SEED = 4_294_967_295
# The first thing that each command does after it has checked its arguments.
FIRST_WORK = {
    evaluate: "keras_pendulum.environments.task.Task.make_env",
    page: "keras_pendulum.page.build.episode_values",
    play: "keras_pendulum.play.__main__.require_display",
    study: "keras_pendulum.study.__main__.require_tensorflow",
}
GRAVITY = ("-0.0001", "0", "100", "100.0001")
SEED = ("-1", "0", "4294967295", "4294967296")
# Those of the settings, which are the flags of `train`, are in config/test_config.py.
# The words before the number, then the number below the lowest, the lowest, the highest, and the
# number above the highest.
LIMITS: list[tuple[Any, list[str], tuple[str, str, str, str]]] = [
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
    refusal: Refusal,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def accept(*arguments: object, **named: object) -> None:
        raise kp.UserError("accepted")

    monkeypatch.setattr(FIRST_WORK[command], accept)
    accepted = []
    for number in numbers:
        error = refusal(command.main, [*words, number])
        accepted.append(error == "error: accepted\n")
        assert accepted[-1] or "; expected a" in error
    assert accepted == [False, True, True, False]


def test_run_of_the_greatest_seed_is_saved(short_ending: None, tmp_path: Path) -> None:
    sizes = {"episodes": 3, "warmup_episodes": 1, "hidden_units": (8,)}
    result = kp.train_dqn(kp.preset("reference", seed=GREATEST_SEED, **sizes), tmp_path)
    assert result.history[-1].updates > 0
    assert kp.load_weights(tmp_path).metadata["seed"] == GREATEST_SEED


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
