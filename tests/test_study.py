"""The study as a person starts it: resumed, hurt and mistyped, on processes and on a cluster."""

from __future__ import annotations

import csv
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import psutil
import pytest
from conftest import Command, command_line, without_gpu_note

import keras_pendulum as kp
from keras_pendulum import study, study_run
from keras_pendulum.arms import own_arms
from keras_pendulum.errors import UserError
from keras_pendulum.presets import preset
from keras_pendulum.study_folder import StudyFolder
from keras_pendulum.study_result import (
    Job,
    Result,
    decode,
    encode,
    installed_versions,
    thinned,
)
from keras_pendulum.study_run import Outcome, train_and_score

# Learning starts with episode 41: these make updates too.
ARMS = [
    "--arm",
    "small: reference hidden_units=8 episodes=43",
    "--arm",
    "starved: original hidden_units=8 episodes=43",
]
NAMES = {
    f"{arm}/{arm}-seed{seed}.json": (arm, seed) for arm in ("small", "starved") for seed in (0, 1)
}


def result_files(folder: Path) -> dict[str, bytes]:
    results = folder / "results"
    return {
        path.relative_to(results).as_posix(): path.read_bytes() for path in results.glob("*/*.json")
    }


def runs_made(folder: Path) -> list[tuple[str, int]]:
    """The runs by the log of their costs, in the order in which they ended."""
    with open(folder / "seconds.csv", newline="") as file:
        return [(row["arm"], int(row["seed"])) for row in csv.DictReader(file)]


def wait_for(what: Callable[[], object]) -> None:
    deadline = time.monotonic() + 120
    while not what():
        assert time.monotonic() < deadline
        time.sleep(0.02)


@contextmanager
def started(*words: str | Path, own_group: bool = False) -> Iterator[subprocess.Popen[str]]:
    """A process that is not left behind."""
    with subprocess.Popen(
        [str(word) for word in words],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=own_group,
    ) as process:
        try:
            yield process
        finally:
            process.kill()


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study of two arms and two seeds, killed by SIGKILL after its first result, and gone on."""
    folder = tmp_path_factory.mktemp("study") / "here"
    words = command_line("study", *ARMS, "--seeds", "2", "--workers", "1", "--out", str(folder))
    with started(*words) as process:
        wait_for(lambda: result_files(folder))
        process.kill()
    before = result_files(folder)
    assert 1 <= len(before) < len(NAMES)
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert f"{len(before)} of 4 runs are there already" in done.stdout
    assert "seeds per core-hour" in done.stdout
    assert result_files(folder).items() >= before.items()
    return folder


def workers_of(process: subprocess.Popen[str]) -> list[psutil.Process]:
    return [
        child
        for child in psutil.Process(process.pid).children()
        if "spawn_main" in " ".join(child.cmdline())
    ]


def test_a_study_killed_in_mid_run_goes_on_and_repeats_nothing(finished: Path) -> None:
    assert result_files(finished).keys() == NAMES.keys()
    made = runs_made(finished)
    # Killed between a result and its line in the log of costs, it lacks that line.
    assert len(made) == len(set(made)) >= len(NAMES) - 1


def test_the_table_comes_as_markdown_json_and_csv_with_a_figure(finished: Path) -> None:
    rows = json.loads((finished / "table.json").read_text())["rows"]
    files = {name: json.loads(data)["result"] for name, data in result_files(finished).items()}
    for row in rows:
        regrets = [files[f"{row['arm']}/{row['arm']}-seed{seed}.json"]["regret"] for seed in (0, 1)]
        assert row["regrets"] == regrets
        assert row["regret_iqm"] == pytest.approx(sum(regrets) / 2)
        assert row["regret_low"] <= row["regret_iqm"] <= row["regret_high"]
    with open(finished / "table.csv", newline="") as file:
        table = list(csv.DictReader(file))
    assert [row["arm"] for row in table] == [row["arm"] for row in rows] == ["small", "starved"]
    assert float(table[1]["regret_iqm"]) == rows[1]["regret_iqm"]
    assert (finished / "table.md").read_text().count("\n| s") == 2
    assert (finished / "figure.png").read_bytes().startswith(b"\x89PNG")


def test_a_run_is_what_the_library_trains_with_that_seed(finished: Path) -> None:
    first, second = (
        json.loads((finished / f"results/small/small-seed{seed}.json").read_bytes())["result"]
        for seed in (0, 1)
    )
    trained = kp.train_dqn(preset("reference", hidden_units=(8,), episodes=43, seed=1))
    assert second["returns"] == kp.evaluate_policy(trained.network).returns.tolist()
    learnt = [record.episode_return for record in trained.history]
    assert second["episode_returns"] == thinned(learnt)
    assert first["returns"] != second["returns"]
    assert first["episode_returns"] != second["episode_returns"]


def test_cartpoles_regret_is_what_lacks_to_500_and_a_run_asks_for_one_thread(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked = []
    monkeypatch.setattr(study_run, "keep_to_one_thread", lambda: asked.append("one thread"))
    config = preset("cartpole", hidden_units=(8,), episodes=1)
    job = Job("pole", "pole", config, installed_versions())
    result = decode(train_and_score(job).result, job)
    assert result is not None
    assert result.best_mean_return == 500
    assert 0 < result.regret == 500 - sum(result.returns) / 100 < 500
    assert asked == ["one thread"]


def test_a_damaged_result_is_made_again_as_it_was(finished: Path, command: Command) -> None:
    before = result_files(finished)
    flipped = finished / "results" / "small/small-seed0.json"
    cut = finished / "results" / "starved/starved-seed1.json"
    data = bytearray(flipped.read_bytes())
    data[data.index(b"best_mean_return") + 25] ^= 1  # one digit of a number
    flipped.write_bytes(data)
    cut.write_bytes(cut.read_bytes()[:100])
    done = command("study", *ARMS, "--seeds", "2", "--workers", "2", "--out", finished)
    assert done.returncode == 0, done.stderr
    assert "2 of 4 runs are there already" in done.stdout
    assert result_files(finished) == before


def test_a_killed_worker_costs_its_own_run_alone(finished: Path, tmp_path: Path) -> None:
    folder = tmp_path / "study"
    words = command_line("study", *ARMS, "--seeds", "2", "--workers", "1", "--out", str(folder))
    with started(*words) as process:
        wait_for(lambda: result_files(folder))
        (worker,) = workers_of(process)
        worker.kill()
        output, _ = process.communicate(timeout=120)
    assert process.returncode == 0, output
    assert "tried again, WorkerDiedError: the worker was killed by SIGKILL" in output
    assert result_files(folder) == result_files(finished)


@pytest.mark.parametrize("seconds", [0, 0.05, 0.15])
def test_control_c_stops_at_once_and_says_how_to_go_on(seconds: float, tmp_path: Path) -> None:
    folder = tmp_path / "study"
    words = ["--arm", "long: reference episodes=100000", "--seeds", "8", "--out", str(folder)]
    with started(*command_line("study", *words, "--workers", "8"), own_group=True) as process:
        wait_for(lambda: workers_of(process))
        time.sleep(seconds)  # so far the first worker comes with its imports
        children = psutil.Process(process.pid).children(recursive=True)
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does: the workers get it too
        output = without_gpu_note(process.communicate(timeout=60)[0])  # if a worker came so far
        psutil.wait_procs(children, 60)
        assert not [child for child in children if child.is_running()]
    assert process.returncode == 130
    assert output.endswith(
        f"0 of 8 runs are in {folder}; the same command goes on with the others\n"
    )
    assert output.count("\n") == 1


def test_a_cluster_that_loses_a_worker_gives_the_same_bytes_and_a_lost_one_is_told(
    finished: Path, tmp_path: Path, command: Command
) -> None:
    python, card = sys.executable, tmp_path / "scheduler.json"
    place = ["--scheduler-file", str(card), "--no-dashboard"]
    server = [python, "-m", "distributed.cli.dask_scheduler", *place, "--host", "127.0.0.1"]
    worker = [python, "-m", "distributed.cli.dask_worker", *place, "--no-nanny", "--nthreads"]
    folder = tmp_path / "study"
    with started(*server, "--port", "0") as scheduler:
        wait_for(card.exists)
        wait_for(lambda: card.read_text().endswith("}"))
        address = json.loads(card.read_text())["address"]
        with started(*worker, "2"):
            wide = command("study", *ARMS, "--out", folder, "--scheduler", address)
        assert (wide.returncode, wide.stderr.count("\n")) == (2, 1)
        assert "has 2 threads: start workers with --nthreads 1" in wide.stderr
        with started(*worker, "1") as first, started(*worker, "1"):
            words = [*ARMS, "--seeds", "2", "--out", str(folder), "--scheduler", address]
            with started(*command_line("study", *words)) as process:
                wait_for(lambda: result_files(folder))
                first.kill()
                output, _ = process.communicate(timeout=200)
            words[words.index("2")] = "9"
            longer = Path(f"{folder}-longer")
            words[words.index(str(folder))] = str(longer)
            with started(*command_line("study", *words)) as gone:
                wait_for(lambda: result_files(longer))
                scheduler.kill()
                complaint, _ = gone.communicate(timeout=100)
    assert gone.returncode == 2
    assert re.search(r"^error: the scheduler at .* has gone: no result is lost.*$", complaint, re.M)
    assert result_files(longer)
    assert process.returncode == 0, output
    assert result_files(folder) == result_files(finished)
    assert sorted(runs_made(folder)) == sorted(NAMES.values())
    for name in ("table.md", "table.json", "table.csv"):
        assert (folder / name).read_bytes() == (finished / name).read_bytes()


WRONG = [
    (["--presets", "nonsense"], "unknown preset 'nonsense'"),
    (["--presets", "reference,"], "the name is empty"),
    (["--presets", "reference,reference"], "two arms have the name 'reference'"),
    (["--arm", "a: reference colour=red"], "unknown setting 'colour'"),
    (["--seeds", "0"], "--seeds is 0; expected a whole number from 1"),
    (["--workers", "-1"], "--workers is -1"),
    (["--workers", "1", "--scheduler", "x:1"], "not allowed with"),
    (["--out", "file"], "cannot make the folder file"),
    (["--out", "other"], "other holds another study"),
    (["--out", "full"], "full holds something else than a study"),
    (["--out", "broken"], "study.json is damaged"),
    (["--out", "old"], "this machine has numpy"),
    (["--scheduler", "no such place"], "no scheduler answers at no such place"),
]


@pytest.mark.parametrize(("words", "message"), WRONG, ids=lambda value: str(value)[:50])
def test_a_mistake_gets_one_clear_line_and_loses_nothing(
    words: list[str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("file").write_text("mine")
    for name, content in {
        "other": "{}",
        "broken": "{",
        "old": '{"versions": {"numpy": "1"}}',
    }.items():
        Path(name).mkdir()
        Path(name, "study.json").write_text(content)
    Path("full").mkdir()
    Path("full", "config.json").touch()
    before = sorted(Path().rglob("*"))
    try:
        status = study.main(words)
    except SystemExit as exit:  # argparse leaves by itself
        status = int(str(exit.code))
    printed = capsys.readouterr()
    assert (status, printed.out) == (2, "")
    assert re.fullmatch(r"error: .*\n", printed.err)
    assert message in printed.err
    assert sorted(Path().rglob("*")) == before
    assert Path("file").read_text() == "mine"
    assert Path("other", "study.json").read_text() == "{}"


def test_other_versions_elsewhere_are_told(finished: Path, tmp_path: Path) -> None:
    arms = own_arms([], [text for text in ARMS if text != "--arm"])
    folder = StudyFolder(finished, arms, 2)
    assert not folder.missing()
    folder.versions = {**folder.versions, "keras": "2.0"}
    assert len(folder.missing()) == 4  # results of other versions are not taken for this study's


def outcome(job: Job) -> Outcome:
    """A run that was made without learning."""
    return Outcome(encode(job, Result(0.0, [-1.5], [-0.1], [-1.5])), 1.0, 2.0, 4.0, "there:7")


def test_runs_that_fail_are_told_and_the_same_command_tries_them_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def diverge(job: Job) -> Outcome:
        if (job.arm, job.config.seed) == ("starved", 0):
            raise UserError("the loss is nan")
        return outcome(job)

    monkeypatch.setattr("keras_pendulum.worker_processes.WorkerProcesses", ThreadPoolExecutor)
    monkeypatch.setattr(study_run, "train_and_score", diverge)
    words = [*ARMS, "--seeds", "2", "--workers", "1", "--out", str(tmp_path / "study")]
    assert study.main(words) == 1
    printed = capsys.readouterr()
    assert printed.err == (
        "starved, seed 0: failed, the loss is nan\n"
        "error: 1 of 4 runs failed (starved, seed 0: the loss is nan); the same command tries them "
        "again\n"
    )
    assert re.findall(r"^(.*): regret 1\.50, 4\.0 s, (\d/\d)", printed.out, re.M) == [
        ("small, seed 0", "1/4"),
        ("small, seed 1", "2/4"),
        ("starved, seed 1", "3/4"),
    ]

    monkeypatch.setattr(study_run, "train_and_score", outcome)
    assert study.main(words) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    assert printed.out.startswith("3 of 4 runs are there already\nstarved, seed 0: regret 1.50, ")
    assert ", 4/4, 0:00 left\n" in printed.out


def test_a_result_that_came_damaged_is_refused_and_a_sound_ones_cost_is_noted(
    tmp_path: Path,
) -> None:
    folder = StudyFolder(tmp_path / "study", own_arms(["reference"], []), 2)
    with folder.opened():
        one, two = folder.jobs()
        for data in (outcome(one).result[:-9], outcome(two).result):  # cut, and of another run
            with pytest.raises(UserError, match="there:7 sent a damaged result of reference"):
                folder.keep(one, outcome(one)._replace(result=data))
        assert not result_files(folder.path)
        folder.keep(two, outcome(two))
        assert folder.missing() == [one]
    with open(folder.path / "seconds.csv", newline="") as file:
        (row,) = csv.DictReader(file)
    assert row == {
        "arm": "reference",
        "seed": "1",
        "worker": "there:7",
        "training": "1.000",
        "evaluation": "2.000",
        "total": "4.000",
    }


def test_no_result_goes_into_a_folder_that_took_the_studys_place(tmp_path: Path) -> None:
    place, link = tmp_path / "study", tmp_path / "link"
    place.mkdir()
    link.symlink_to(place)
    folder = StudyFolder(link, own_arms(["reference"], []), 2)
    with folder.opened():
        one, two = folder.jobs()
        link.unlink()
        link.symlink_to(tmp_path)
        folder.keep(one, outcome(one))
        assert len(result_files(place)) == 1
        place.rename(tmp_path / "moved")
        shutil.copytree(tmp_path / "moved", place)
        with pytest.raises(UserError, match="study was moved, removed or replaced"):
            folder.keep(two, outcome(two))
    assert len(result_files(place)) == 1


def test_a_worker_of_another_version_makes_no_run() -> None:
    job = Job("arm", "arm", preset("reference"), {**installed_versions(), "keras": "2.0"})
    with pytest.raises(
        UserError, match=r"the worker .* has keras .*, this study 2\.0: use the same"
    ):
        train_and_score(job)


def test_help_comes_without_numpy() -> None:
    code = (
        "import sys\n"
        "from keras_pendulum import study\n"
        "try:\n    study.main(['--help'])\nexcept SystemExit:\n    pass\n"
        "assert not {'numpy', 'scipy', 'tensorflow', 'distributed'} & set(sys.modules)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "--scheduler ADDRESS" in done.stdout


def test_a_missing_extra_is_told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert study.main([]) == 2
    assert capsys.readouterr().err == (
        "error: scipy is not installed: pip install 'keras_pendulum[study]'\n"
    )
