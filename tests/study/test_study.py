"""The command `study`: continued, interrupted and mistyped, on local workers and on a cluster."""

from __future__ import annotations

import csv
import io
import json
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import pytest
from conftest import Refusal
from test_dask_workers import running_scheduler, running_worker

from keras_pendulum.study import __main__ as study_command
from keras_pendulum.study.arms import own_arms
from keras_pendulum.study.job import train_and_score
from keras_pendulum.study.results_folder import ResultsFolder

ARMS = [
    "--arm",
    "small: reference hidden_units=8 episodes=2 warmup_episodes=1",
    "--arm",
    "starved: original hidden_units=8 episodes=2 warmup_episodes=1",
]
NAMES = {
    f"{arm}/{arm}-seed{seed}.json": (arm, seed) for arm in ("small", "starved") for seed in (0, 1)
}
# The command `study`, killed by SIGKILL after its first result.
KILLED = """
import psutil
from keras_pendulum.study.__main__ import main
from keras_pendulum.study.results_folder import ResultsFolder

save = ResultsFolder.save

def save_and_be_killed(*arguments):
    save(*arguments)
    psutil.Process().kill()

ResultsFolder.save = save_and_be_killed
main()
"""
# A worker with this module loaded is killed by SIGKILL when its first run starts.
KILLED_IN_A_RUN = """
import psutil
from keras_pendulum.study import job

job.train_and_score = lambda job: psutil.Process().kill()
"""


def result_files(folder: Path) -> dict[str, bytes]:
    results = folder / "results"
    return {
        path.relative_to(results).as_posix(): path.read_bytes() for path in results.glob("*/*.json")
    }


def logged_runs(folder: Path) -> list[tuple[str, int]]:
    """Returns the runs in the log of costs, in the order in which they finished."""
    with open(folder / "seconds.csv", encoding="utf-8", newline="") as file:
        return [(row["arm"], int(row["seed"])) for row in csv.DictReader(file)]


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study of two arms and two seeds on the worst day.

    It is killed after its first result, on a worker of this machine. A cluster continues it, whose
    first worker is killed in its first run.
    """
    folder = tmp_path_factory.mktemp("study")
    words = [*ARMS, "--seeds", "2", "--out", str(folder / "study")]
    # Its output ends when its worker, which has inherited it, has ended too.
    killed = subprocess.run(
        [sys.executable, "-c", KILLED, *words, "--workers", "1"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (killed.stdout, killed.stderr) == ("", "")
    before = result_files(folder / "study")
    assert before.keys() == {"small/small-seed0.json"}
    output, problems = continue_on_cluster(words, folder)
    assert output.startswith("1 of 4 runs are already finished\n")
    assert "\n3 runs in " in output
    lost = r"lost the worker tcp://127\.0\.0\.1:\d+, interrupting starved, seed 0\n"
    assert re.fullmatch(lost, problems)
    assert result_files(folder / "study").items() >= before.items()
    return folder / "study"


def continue_on_cluster(words: list[str], folder: Path) -> tuple[str, str]:
    """Returns the output of a study whose cluster loses its only worker, and gets another."""
    preload = folder / "killed.py"
    preload.write_text(KILLED_IN_A_RUN, encoding="utf-8")
    output, problems = io.StringIO(), io.StringIO()
    with (
        running_scheduler(folder) as (_, address),
        redirect_stdout(output),
        redirect_stderr(problems),
        ThreadPoolExecutor() as pool,
        running_worker(address, "--preload", preload) as first,
    ):
        study = pool.submit(study_command.main, [*words, "--scheduler", address])
        first.wait()
        with running_worker(address):
            assert study.result() == 0
    return output.getvalue(), problems.getvalue()


def test_killed_study_continues_and_repeats_no_run(finished: Path) -> None:
    assert result_files(finished).keys() == NAMES.keys()
    assert sorted(logged_runs(finished)) == sorted(NAMES.values())


def test_tables_and_figure_are_written(finished: Path) -> None:
    rows = json.loads((finished / "table.json").read_text())["rows"]
    files = {name: json.loads(data)["result"] for name, data in result_files(finished).items()}
    for row in rows:
        regrets = [files[f"{row['arm']}/{row['arm']}-seed{seed}.json"]["regret"] for seed in (0, 1)]
        assert row["regrets"] == regrets
        assert row["regret_iqm"] == pytest.approx(sum(regrets) / 2)
        assert row["regret_low"] <= row["regret_iqm"] <= row["regret_high"]
    assert [row["arm"] for row in rows] == ["small", "starved"]
    assert (finished / "table.csv").read_text().count("\ns") == 2
    assert (finished / "table.md").read_text().count("\n| s") == 2
    assert (finished / "figure.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("name", ["small/small-seed0.json", "starved/starved-seed1.json"])
def test_result_of_each_place_has_the_bytes_of_a_run_in_this_process(
    name: str, finished: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("keras_pendulum.study.job.use_one_thread", lambda: None)
    jobs = ResultsFolder(finished, own_arms([], ARMS[1::2]), 2).jobs()
    (job,) = (job for job in jobs if (job.arm, job.config.seed) == NAMES[name])
    assert (finished / "results" / name).read_bytes() == train_and_score(job).result


def test_complete_study_starts_no_workers(
    finished: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delattr("keras_pendulum.study.dask_workers.local_workers")
    assert study_command.main([*ARMS, "--seeds", "2", "--out", str(finished)]) == 0
    assert capsys.readouterr().out.startswith("4 of 4 runs are already finished\n\n| arm | ")


WRONG = [
    (["--presets", "nonsense"], "unknown preset 'nonsense'"),
    (["--presets", "reference,"], "the name is empty"),
    (["--presets", "reference,reference"], "two arms have the name 'reference'"),
    (["--arm", "a: reference colour=red"], "unknown setting colour"),
    (["--workers", "1", "--scheduler", "x:1"], "not allowed with"),
    (["--out", "file"], "cannot read the folder file: Not a directory"),
    (["--out", "other"], "other holds another study"),
    (["--out", "full"], "full holds something other than a study"),
    (["--out", "broken"], "study.json is damaged"),
    (["--out", "old"], "this machine has numpy"),
]


@pytest.mark.parametrize(("words", "message"), WRONG, ids=lambda value: str(value)[:50])
def test_mistake_is_one_error_line_and_changes_no_file(
    words: list[str], message: str, tmp_path: Path, refusal: Refusal
) -> None:
    contents = {
        "file": "mine",
        "other/study.json": "{}",
        "broken/study.json": "{",
        "old/study.json": '{"versions": {"numpy": "1"}}',
        "full/config.json": "",
    }
    for name, content in contents.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(content, encoding="utf-8")
    assert message in refusal(study_command.main, words)


def test_missing_package_is_an_error_that_names_the_extra(
    refusal: Refusal, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert refusal(study_command.main, []) == (
        'error: scipy is not installed: pip install -e ".[study]" in the clone\n'
    )
