"""The command `study`: continued, interrupted and mistyped, on local workers and on a cluster."""

from __future__ import annotations

import csv
import json
import re
import subprocess
import sys
from contextlib import AbstractContextManager
from pathlib import Path

import pytest
from conftest import Command, command_line, running_module, wait_for

import keras_pendulum as kp
from keras_pendulum.config.presets import preset
from keras_pendulum.study import __main__ as study_command
from keras_pendulum.study.job import curve_points

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
    """A study of two arms and two seeds: killed after its first result, then continued."""
    folder = tmp_path_factory.mktemp("study") / "local"
    words = [*ARMS, "--seeds", "2", "--workers", "1", "--out", str(folder)]
    # Its output ends when its worker, which has inherited it, has ended too.
    killed = subprocess.run(
        [sys.executable, "-c", KILLED, *words], capture_output=True, text=True, check=False
    )
    assert (killed.stdout, killed.stderr) == ("", "")
    before = result_files(folder)
    assert len(before) == 1
    done = subprocess.run(command_line("study", *words), capture_output=True, text=True, check=True)
    assert done.stdout.startswith("1 of 4 runs are already finished\n")
    assert "\n3 runs in " in done.stdout
    assert done.stderr == ""
    assert result_files(folder).items() >= before.items()
    return folder


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
    with open(finished / "table.csv", encoding="utf-8", newline="") as file:
        table = list(csv.DictReader(file))
    assert [row["arm"] for row in table] == [row["arm"] for row in rows] == ["small", "starved"]
    assert float(table[1]["regret_iqm"]) == rows[1]["regret_iqm"]
    assert (finished / "table.md").read_text().count("\n| s") == 2
    assert (finished / "figure.png").read_bytes().startswith(b"\x89PNG")


def test_run_equals_train_dqn_with_the_same_seed(finished: Path) -> None:
    first, second = (
        json.loads((finished / f"results/small/small-seed{seed}.json").read_bytes())["result"]
        for seed in (0, 1)
    )
    trained = kp.train_dqn(
        preset("reference", hidden_units=(8,), episodes=2, warmup_episodes=1, seed=1)
    )
    assert second["returns"] == kp.evaluate_policy(trained.network).returns.tolist()
    episode_returns = [record.episode_return for record in trained.history]
    assert second["episode_returns"] == curve_points(episode_returns)
    assert first["returns"] != second["returns"]
    assert first["episode_returns"] != second["episode_returns"]


def test_damaged_results_are_made_again_with_the_same_bytes(
    finished: Path, in_process: Command
) -> None:
    before = result_files(finished)
    flipped = finished / "results" / "small/small-seed0.json"
    cut = finished / "results" / "starved/starved-seed1.json"
    data = bytearray(flipped.read_bytes())
    data[data.index(b"optimal_mean_return") + 25] ^= 1  # one digit of a number
    flipped.write_bytes(data)
    cut.write_bytes(cut.read_bytes()[:100])
    done = in_process("study", *ARMS, "--seeds", "2", "--workers", "2", "--out", finished)
    assert done.returncode == 0, done.stderr
    assert "2 of 4 runs are already finished" in done.stdout
    assert result_files(finished) == before


def test_complete_study_starts_no_workers(
    finished: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delattr("keras_pendulum.study.dask_workers.local_workers")
    assert study_command.main([*ARMS, "--seeds", "2", "--out", str(finished)]) == 0
    assert capsys.readouterr().out.startswith("4 of 4 runs are already finished\n\n| arm | ")


def test_cluster_that_loses_a_worker_gives_the_same_bytes(finished: Path, tmp_path: Path) -> None:
    file, killed = tmp_path / "scheduler.json", tmp_path / "killed.py"
    killed.write_text(KILLED_IN_A_RUN, encoding="utf-8")
    place = ["--scheduler-file", str(file), "--no-dashboard"]
    server = ["distributed.cli.dask_scheduler", *place, "--host", "127.0.0.1", "--port", "0"]
    worker = ["distributed.cli.dask_worker", *place, "--no-nanny", "--nthreads", "1"]
    folder = tmp_path / "study"
    with running(*server):
        wait_for(lambda: file.exists() and file.read_text().endswith("}"))
        address = json.loads(file.read_text())["address"]
        words = [*ARMS, "--scheduler", address, "--seeds", "2", "--out", folder]
        study = running("keras_pendulum.study", *words)
        with running(*worker, "--preload", killed) as first, study as process:
            first.communicate()
            with running(*worker):
                output, _ = process.communicate()
    assert process.returncode == 0, output
    (problem,) = [
        line
        for line in output.split("\n\n")[0].splitlines()
        if not re.match(r"\w+, seed \d: regret |\d+ runs in ", line)
    ]
    assert re.match(r"lost the worker tcp://127\.0\.0\.1:\d+, interrupting \w+, seed \d$", problem)
    assert result_files(folder) == result_files(finished)
    assert sorted(logged_runs(folder)) == sorted(NAMES.values())
    for name in ("table.md", "table.json", "table.csv"):
        assert (folder / name).read_bytes() == (finished / name).read_bytes()


def running(module: str, *words: str | Path) -> AbstractContextManager[subprocess.Popen[str]]:
    return running_module(
        module, *words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )


WRONG = [
    (["--presets", "nonsense"], "unknown preset 'nonsense'"),
    (["--presets", "reference,"], "the name is empty"),
    (["--presets", "reference,reference"], "two arms have the name 'reference'"),
    (["--arm", "a: reference colour=red"], "unknown setting colour"),
    (["--seeds", "0"], "--seeds is 0; expected a whole number from 1"),
    (["--workers", "-1"], "--workers is -1"),
    (["--workers", "1", "--scheduler", "x:1"], "not allowed with"),
    (["--out", "file"], "cannot read the folder file: Not a directory"),
    (["--out", "other"], "other holds another study"),
    (["--out", "full"], "full holds something other than a study"),
    (["--out", "broken"], "study.json is damaged"),
    (["--out", "old"], "this machine has numpy"),
    (["--scheduler", "no such place"], "no scheduler answers at no such place"),
]


@pytest.mark.parametrize(("words", "message"), WRONG, ids=lambda value: str(value)[:50])
def test_mistake_is_one_error_line_and_changes_no_file(
    words: list[str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("file").write_text("mine", encoding="utf-8")
    for name, content in {
        "other": "{}",
        "broken": "{",
        "old": '{"versions": {"numpy": "1"}}',
    }.items():
        Path(name).mkdir()
        Path(name, "study.json").write_text(content, encoding="utf-8")
    Path("full").mkdir()
    Path("full", "config.json").touch()
    before = sorted(Path().rglob("*"))
    try:
        status = study_command.main(words)
    except SystemExit as exit:  # from argparse
        status = int(str(exit.code))
    printed = capsys.readouterr()
    assert (status, printed.out) == (2, "")
    assert re.fullmatch(r"error: .*\n", printed.err)
    assert message in printed.err
    assert sorted(Path().rglob("*")) == before
    assert Path("file").read_text(encoding="utf-8") == "mine"
    assert Path("other", "study.json").read_text(encoding="utf-8") == "{}"


def test_missing_package_is_an_error_that_names_the_extra(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert study_command.main([]) == 2
    assert capsys.readouterr().err == (
        'error: scipy is not installed: pip install "keras_pendulum[study]"\n'
    )
