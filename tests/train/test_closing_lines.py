"""The lines after a run: what was learned, why not, and what to do next."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Command

import keras_pendulum as kp
from keras_pendulum.cli import shell_word
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.storage.run_folder import RunFolder
from keras_pendulum.train import evaluations
from keras_pendulum.train.closing_lines import next_lines, result_lines


def record(episode: int, updates: int, **changes: Any) -> EpisodeRecord:
    steps = 200 * (episode + 1)
    return EpisodeRecord(episode, -1.0, -200.0, 0.5, 0.1, steps, updates, 0.1)._replace(**changes)


def lines_after(
    config: kp.Config,
    history: list[EpisodeRecord],
    path: Path,
    *,
    score: kp.Score | None = None,
    finished: bool = True,
) -> list[str]:
    result = kp.TrainingResult(kp.DQN((8,)), history, finished, score)
    folder = RunFolder(path, config.environment)
    first = result_lines(config, result, folder, 1.5, new_episodes=1)
    last = next_lines(config, result, folder, new_episodes=1)
    return [*first.splitlines(), *last.splitlines()]


def warnings(config: kp.Config, last: EpisodeRecord, mean_return: float, folder: Path) -> list[str]:
    """Returns the lines between the return of random actions and the list of the files."""
    optimum = -36.68 if config.gravity is not None else 500.0
    score = kp.Score(config.task, np.array([mean_return]), np.array([optimum]))
    lines = lines_after(config, [last], folder, score=score)
    first = next(i for i, line in enumerate(lines) if line.startswith("Uniformly random")) + 1
    return lines[first : next(i for i, line in enumerate(lines) if line.startswith("Saved in"))]


NO_UPDATE = [
    (
        kp.preset("reference", episodes=40, warmup_episodes=41),
        record(39, 0),
        "the first one comes after 42 episodes, and the run has 40. Continue it with --resume "
        "--episodes 500, or start another one with a smaller --warmup-episodes (now 41)",
    ),
    (
        kp.preset("reference", warmup_episodes=700),
        record(499, 0),
        "the first one comes after 701 episodes, and the run has 500. Continue it with --resume "
        "--episodes 1400, or start another one with a smaller --warmup-episodes (now 700)",
    ),
    (
        kp.preset("cartpole-original", episodes=3),
        record(2, 0, environment_steps=70),
        "its 70 transitions are fewer than one batch. Continue it with --resume --episodes 600, "
        "or start another one with a smaller --batch-size (now 128)",
    ),
    (
        kp.preset("cartpole", episodes=3, warmup_episodes=1),
        record(2, 0, environment_steps=70),
        "its 70 transitions are fewer than one batch. Continue it with --resume --episodes "
        f"{kp.preset('cartpole').episodes}, "
        "or start another one with a smaller --batch-size (now 128)",
    ),
]


@pytest.mark.parametrize(("config", "last", "reason"), NO_UPDATE)
def test_run_without_updates_says_why(
    config: kp.Config, last: EpisodeRecord, reason: str, tmp_path: Path
) -> None:
    reason = reason.replace("--resume", f"--resume --out {shell_word(tmp_path)}")
    for mean_return in (-2000.0, 0.0):  # also where the policy is not worse than random actions
        assert warnings(config, last, mean_return, tmp_path) == [
            f"The policy has learned nothing, because the run made no update: {reason}"
        ]


@pytest.mark.parametrize(
    ("preset", "bad", "good"),
    [("original", -1500.0, -40.0), ("cartpole-original", 9.4, 300.0)],
)
def test_policy_worse_than_random_actions_names_what_to_do(
    preset: str, bad: float, good: float, tmp_path: Path
) -> None:
    config, last = kp.preset(preset, episodes=500), record(499, 459)
    assert warnings(config, last, bad, tmp_path) == [
        "The policy is worse than random actions. See why with python -m keras_pendulum.diagnose "
        f"{shell_word(tmp_path)}"
    ]
    assert warnings(config, last, good, tmp_path) == []


def test_regret_is_shown_in_two_parts(tmp_path: Path) -> None:
    optimum = kp.optimal_return(1.0, range(100))
    score = kp.Score(Pendulum(), optimum - 3, optimum, 0.9, range(100))
    lines = lines_after(kp.preset("reference"), [record(499, 100)], tmp_path, score=score)
    place = lines.index("Regret: 3.00")
    assert lines[place + 1].startswith(
        "Exact policy for the discount 0.9: regret 0.24. Regret from learning: "
    )
    assert lines[place + 2].startswith("Uniformly random actions")


def test_interrupted_run_is_not_judged_and_can_be_continued(tmp_path: Path) -> None:
    config = kp.preset("reference")
    lines = lines_after(config, [record(3, 0)], tmp_path, finished=False)
    assert lines[0] == "Interrupted after 4 episodes (800 steps, 0 updates); this took 1.5 s."
    assert [line.split(":")[0].split(" in ")[0] for line in lines[1:]] == ["Saved", "Continue"]


def test_evaluations_are_summed_up(tmp_path: Path) -> None:
    config = kp.preset("reference", evaluate_every=50, keep_best=True)
    regrets = [(49, 30.0), (99, 2.345), (149, 2.345), (199, 3.0)]
    history = [record(i, 100, greedy_regret=regret) for i, regret in regrets]
    RunFolder(tmp_path, config.environment).best.touch()
    lines = lines_after(config, history, tmp_path)
    assert lines[1] == (
        "Evaluated 4 times on the starts of seeds 900 to 949: best regret 2.35 after episode 149, "
        "last 3.00"
    )
    assert lines[2].endswith(": pendulum_weight_best.h5")
    assert lines[3].startswith("Evaluate the best weights: python -m keras_pendulum.evaluate ")
    assert lines[3].endswith("pendulum_weight_best.h5")


def test_finished_run_that_is_resumed_says_how_to_extend_it(
    in_process: Command, short_ending: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(evaluations, "SEEDS", range(900, 902))
    words = ["--preset", "original", "--hidden-units", "8", "--episodes", "3", "--out", "my run"]
    words += ["--evaluate-every", "2", "--keep-best"]
    first = in_process("train", *words).stdout.splitlines()
    assert not [line for line in first if "Nothing is left" in line or "Extend it" in line]
    before = (tmp_path / "my run" / "history.csv").read_bytes()
    again = in_process("train", "--resume", "--out", "my run")
    assert again.returncode == 0, again.stderr
    lines = again.stdout.splitlines()
    assert lines[0] == (
        "Nothing is left to train: this run has all of its 3 episodes (600 steps, 0 updates)."
    )
    assert 'Continue it with --resume --out "my run" --episodes 500, or' in again.stdout
    assert (tmp_path / "my run" / "history.csv").read_bytes() == before
    (extend,) = (line for line in lines if line.startswith("Extend it: "))
    assert extend.endswith(" --episodes 500")  # those of the preset
    assert again.stdout.count("--episodes 500") == 2
    extended = in_process("train", *shlex.split(extend)[5:-1], "6")
    assert extended.returncode == 0, extended.stderr
    assert extended.stdout.startswith("Episode: 3, ")
    assert "Trained 6 episodes" in extended.stdout
    assert "Greedy policy after episode 5: regret " in extended.stdout
