"""The command `study`: continued, interrupted and mistyped, on local workers and on a cluster."""

from __future__ import annotations

import csv
import json
import re
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, suppress
from pathlib import Path

import psutil
import pytest
from conftest import Command, command_line, running_module

import keras_pendulum as kp
from keras_pendulum.config.presets import preset
from keras_pendulum.study import __main__ as study_command
from keras_pendulum.study.job import curve_points

# The first update comes after 41 episodes: these runs make some.
ARMS = [
    "--arm",
    "small: reference hidden_units=8 episodes=43",
    "--arm",
    "starved: original hidden_units=8 episodes=43",
]
STUDY = "keras_pendulum.study"
NAMES = {
    f"{arm}/{arm}-seed{seed}.json": (arm, seed) for arm in ("small", "starved") for seed in (0, 1)
}


def result_files(folder: Path) -> dict[str, bytes]:
    results = folder / "results"
    return {
        path.relative_to(results).as_posix(): path.read_bytes() for path in results.glob("*/*.json")
    }


def logged_runs(folder: Path) -> list[tuple[str, int]]:
    """Returns the runs in the log of costs, in the order in which they finished."""
    with open(folder / "seconds.csv", encoding="utf-8", newline="") as file:
        return [(row["arm"], int(row["seed"])) for row in csv.DictReader(file)]


def wait_for(condition: Callable[[], object]) -> None:
    deadline = time.monotonic() + 120
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def running(
    module: str, *words: str | Path, own_group: bool = False
) -> AbstractContextManager[subprocess.Popen[str]]:
    return running_module(
        module,
        *words,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=own_group,
    )


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study of two arms and two seeds: killed by SIGKILL after its first result, then continued.

    It checks that the workers of the killed study end, too.
    """
    folder = tmp_path_factory.mktemp("study") / "local"
    words = [*ARMS, "--seeds", "2", "--workers", "1", "--out", str(folder)]
    with running(STUDY, *words) as process:
        wait_for(lambda: result_files(folder))
        workers = workers_of(process)
        assert len(workers) == 1
        process.kill()
        _, alive = psutil.wait_procs(workers, 60)
        assert [worker for worker in alive if worker.status() != psutil.STATUS_ZOMBIE] == []
        output, _ = process.communicate(timeout=60)
        assert "Traceback" not in output
    before = result_files(folder)
    assert 1 <= len(before) < len(NAMES)
    done = subprocess.run(command_line("study", *words), capture_output=True, text=True, check=True)
    assert f"{len(before)} of 4 runs are already finished" in done.stdout
    assert f"{len(NAMES) - len(before)} runs in " in done.stdout
    assert done.stderr == ""
    assert result_files(folder).items() >= before.items()
    return folder


def workers_of(process: subprocess.Popen[str]) -> list[psutil.Process]:
    """Returns the running worker processes of a study."""
    workers = []
    for child in psutil.Process(process.pid).children():
        with suppress(psutil.NoSuchProcess):  # it has ended meanwhile
            if "spawn_main" in " ".join(child.cmdline()):
                workers.append(child)
    return workers


def test_study_killed_in_the_middle_continues_and_repeats_no_run(finished: Path) -> None:
    assert result_files(finished).keys() == NAMES.keys()
    runs = logged_runs(finished)
    # If it was killed after a result but before its line in the log, that line is missing.
    assert len(runs) == len(set(runs)) >= len(NAMES) - 1


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
    trained = kp.train_dqn(preset("reference", hidden_units=(8,), episodes=43, seed=1))
    assert second["returns"] == kp.evaluate_policy(trained.network).returns.tolist()
    episode_returns = [record.episode_return for record in trained.history]
    assert second["episode_returns"] == curve_points(episode_returns)
    assert first["returns"] != second["returns"]
    assert first["episode_returns"] != second["episode_returns"]


def test_damaged_results_are_made_again_with_the_same_bytes(
    finished: Path, command: Command
) -> None:
    before = result_files(finished)
    flipped = finished / "results" / "small/small-seed0.json"
    cut = finished / "results" / "starved/starved-seed1.json"
    data = bytearray(flipped.read_bytes())
    data[data.index(b"optimal_mean_return") + 25] ^= 1  # one digit of a number
    flipped.write_bytes(data)
    cut.write_bytes(cut.read_bytes()[:100])
    done = command("study", *ARMS, "--seeds", "2", "--workers", "2", "--out", finished)
    assert done.returncode == 0, done.stderr
    assert "2 of 4 runs are already finished" in done.stdout
    assert result_files(finished) == before


def test_complete_study_starts_no_workers(
    finished: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delattr("keras_pendulum.study.dask_workers.local_workers")
    assert study_command.main([*ARMS, "--seeds", "2", "--out", str(finished)]) == 0
    assert capsys.readouterr().out.startswith("4 of 4 runs are already finished\n\n| arm | ")


def test_run_of_a_killed_worker_is_repeated(finished: Path, tmp_path: Path) -> None:
    folder = tmp_path / "study"
    words = [*ARMS, "--seeds", "2", "--workers", "1", "--out", str(folder)]
    with running(STUDY, *words) as process:
        wait_for(lambda: result_files(folder))
        (worker,) = workers_of(process)
        worker.kill()
        output = process.communicate(timeout=120)[0]
    assert process.returncode == 0, output
    assert re.search(
        r"^lost the worker tcp://127\.0\.0\.1:\d+, interrupting \w+, seed \d", output, re.M
    )
    assert problem_lines(output) == 1
    assert result_files(folder) == result_files(finished)


def problem_lines(output: str) -> int:
    """Returns the number of lines before the table that are no progress lines."""
    lines = output.split("\n\n")[0].splitlines()
    progress = re.compile(r"\w+, seed \d: regret |\d+ runs in ")
    return len([line for line in lines if not progress.match(line)])


def test_cluster_that_loses_a_worker_gives_the_same_bytes(finished: Path, tmp_path: Path) -> None:
    file = tmp_path / "scheduler.json"
    place = ["--scheduler-file", str(file), "--no-dashboard"]
    server = ["distributed.cli.dask_scheduler", *place, "--host", "127.0.0.1"]
    worker = ["distributed.cli.dask_worker", *place, "--no-nanny", "--nthreads", "1"]
    folder, longer = tmp_path / "study", tmp_path / "longer"
    with running(*server, "--port", "0") as scheduler:
        wait_for(lambda: file.exists() and file.read_text().endswith("}"))
        address = json.loads(file.read_text())["address"]
        words = [STUDY, *ARMS, "--scheduler", address, "--seeds"]
        with running(*worker) as first, running(*worker):
            with running(*words, "2", "--out", folder) as process:
                wait_for(lambda: result_files(folder))
                first.kill()
                output, _ = process.communicate(timeout=200)
            with running(*words, "9", "--out", longer) as gone:
                wait_for(lambda: result_files(longer))
                scheduler.kill()
                complaint, _ = gone.communicate(timeout=100)
    assert process.returncode == 0, output
    assert re.search(r"^lost the worker tcp://127\.0\.0\.1:\d+", output, re.M)
    assert problem_lines(output) == 1
    assert result_files(folder) == result_files(finished)
    assert sorted(logged_runs(folder)) == sorted(NAMES.values())
    for name in ("table.md", "table.json", "table.csv"):
        assert (folder / name).read_bytes() == (finished / name).read_bytes()
    assert gone.returncode == 2
    assert complaint.splitlines()[-1].startswith(f"error: the scheduler at {address} is gone: ")
    assert problem_lines(complaint) == 1


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


def test_help_imports_no_numpy() -> None:
    code = (
        "import sys\n"
        "from keras_pendulum.study import __main__ as study\n"
        "try:\n    study.main(['--help'])\nexcept SystemExit:\n    pass\n"
        "assert not {'numpy', 'scipy', 'tensorflow', 'distributed'} & set(sys.modules)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "--scheduler ADDRESS" in done.stdout


def test_missing_package_is_an_error_that_names_the_extra(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert study_command.main([]) == 2
    assert capsys.readouterr().err == (
        'error: scipy is not installed: pip install "keras_pendulum[study]"\n'
    )
