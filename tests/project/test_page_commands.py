"""The commands of README.md and docs, typed in their order in one folder, and what they print."""

from __future__ import annotations

import importlib.util
import re
import shlex
import webbrowser
from collections.abc import Callable, Iterator
from dataclasses import fields
from itertools import pairwise
from pathlib import Path
from typing import Any

import gymnasium
import keras
import pytest
from conftest import ROOT, Command, ending_shortly

import keras_pendulum as kp
from keras_pendulum.history import EpisodeRecord

README = ROOT / "README.md"
FIRST_RUN = "runs/reference-seed0"  # made by the first line of README.md, before any other page
# install.md has the lines of README.md. benchmarks.md has what the maintainers run.
OTHERS = ("install.md", "benchmarks.md")
# Their tests are in tests/play and tests/study: a window, and a study of ten seeds.
NOT_RUN = ("play", "study")
AGENTS = """
import keras_pendulum as kp


def push_upright(observation):
    _, sin, speed = observation
    return max(-2.0, min(2.0, float(-10 * sin - 2 * speed)))


policy = push_upright
model = kp.DQN((8,), 5)
q_function = kp.q_function(kp.DQN((8,)))
"""


def pages() -> list[Path]:
    """Returns README.md, and the pages with commands in the order of the index."""
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    names = re.findall(r"\| \[[^]]+\]\((\w+\.md)\)", index)
    found = [README, *(ROOT / "docs" / name for name in names if name not in OTHERS)]
    return [page for page in found if commands(page)]


def commands(page: Path) -> list[str]:
    """Returns the commands of a page, without `python -m keras_pendulum.`, in their order."""
    text = page.read_text(encoding="utf-8")
    found = re.findall(r"(?<!\\)python -m keras_pendulum\.([^\n`#&|…]+)(…?)", text)
    # `evaluate` without an agent is its name in a sentence.
    return [line.strip() for line, dots in found if not dots and line.strip() != "evaluate"]


PAGES = pages()


def folder_of(words: list[str]) -> str:
    """Returns the folder of a training with these words."""
    values = {"--preset": "reference", "--seed": "0", **dict(pairwise(words))}
    return values.get("--out", f"runs/{values['--preset']}-seed{values['--seed']}")


def misplaced(lines: list[str], made: set[str]) -> Iterator[str]:
    """Yields the commands whose run folder is missing or used before; adds what they make."""
    for line in lines:
        name, *words = shlex.split(line)
        needed = {"/".join(word.split("/")[:2]) for word in words if word.startswith("runs/")}
        if name == "train":
            folder = folder_of(words)
            needed = {folder} if "--resume" in words else set()
            if "--resume" not in words and folder in made:
                yield line
            made.add(folder)
        if not needed <= made:
            yield line


@pytest.mark.parametrize("page", PAGES[1:], ids=lambda page: page.name)
def test_page_needs_only_the_first_run(page: Path) -> None:
    assert list(misplaced(commands(page), {FIRST_RUN})) == []


def test_no_command_uses_the_folder_of_another_one() -> None:
    lines = [line for page in PAGES for line in commands(page)]
    assert list(misplaced(lines, set())) == []


def test_misplaced_command_is_found() -> None:
    lines = ["train --seed 3", "train --seed 3 --resume", "train --seed 3 --gravity 2"]
    assert list(misplaced([*lines, "compare runs/other"], set())) == [
        lines[2],
        "compare runs/other",
    ]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Returns the folder of all pages, with the user's own files."""
    path = tmp_path_factory.mktemp("pages")
    (path / "my_agent.py").write_text(AGENTS, encoding="utf-8")
    model = keras.Sequential([keras.Input((3,)), keras.layers.Dense(5)])
    model.save(path / "mine.keras")
    env = kp.Recorder(gymnasium.make("Pendulum-v1"))
    env.reset(seed=0)
    env.step([0.0])
    env.save(path / "run.npz")
    return path


@pytest.fixture(scope="module")
def no_picture() -> Iterator[None]:
    """Draws nothing after a run. Its score is the whole one, which the pages show."""
    with ending_shortly(starts=100):
        yield


@pytest.fixture
def type_command(
    folder: Path, in_process: Command, monkeypatch: pytest.MonkeyPatch, no_picture: None
) -> Callable[[str], str]:
    """Runs a command in the folder of the pages, and returns what it prints."""
    monkeypatch.chdir(folder)
    monkeypatch.setattr(webbrowser, "open", lambda address: True)

    def run(line: str) -> str:
        done = in_process(*shortened(line))
        assert done.returncode == 0, (line, done.stderr)
        return done.stdout

    return run


def shortened(line: str) -> list[str]:
    """Returns the words of a command with few episodes and a small network.

    A discount and a gravity become those of `reference`, whose exact solution is stored.
    """
    name, *words = shlex.split(line)
    # Both flags need a display.
    words = [word.replace("YOURS", "0.985") for word in words if word not in ("--live", "--open")]
    if name != "train":
        return [name, *words]
    if not importlib.util.find_spec("tensorboard"):
        words = [word for word in words if word != "--tensorboard"]
    few = {"--episodes": 50, "--evaluate-every": 25, "--snapshots": 5}
    usual = {"--gravity": "1", "--discount": "0.9"}
    values = dict(pairwise(words))
    for place, flag in enumerate(words):
        if flag in few:
            words[place + 1] = str(int(values[flag]) // few[flag])
        elif flag in usual:
            words[place + 1] = usual[flag]
    if "--episodes" not in words:
        words += ["--episodes", "4"]
    return [name, *words, "--hidden-units", "8", "--warmup-episodes", "1"]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_of_the_pages_follow_one_another(
    page: Path, type_command: Callable[[str], str]
) -> None:
    if page != README and not Path(FIRST_RUN).exists():  # this test alone
        type_command("train")
    for line in commands(page):
        # The best return from a film's start takes 20 s: tests/evaluate/test_film.py has it.
        if line.split()[0] not in NOT_RUN and "--start" not in line:
            printed = type_command(line)
            for shown in SHOWN.get((page.name, line), ()):
                shown(page, printed)


def test_commands_of_the_pages_are_those_of_the_comparisons() -> None:
    for name, line in SHOWN:
        (page,) = (page for page in PAGES if page.name == name)
        assert line in commands(page)


def block(page: Path, name: str) -> list[str]:
    """Returns the lines of a block of figures, without the fences."""
    text = page.read_text(encoding="utf-8")
    (found,) = re.findall(rf"^<!-- {name}: .*?-->\n(.*?)^<!-- end -->", text, re.M | re.S)
    return [line for line in found.splitlines() if line and not line.startswith("```")]


NUMBER = re.compile(r"-?\d+(?:\.\d+)?")


def require_line(shown: str, printed: str, *, figures: bool) -> None:
    """Fails where no printed line has the shown words, and with `figures` the shown numbers."""
    words = NUMBER.sub("#", shown)
    (line,) = [line for line in printed.splitlines() if NUMBER.sub("#", line) == words]
    if figures:
        # Floating-point rounding of another processor may change an action.
        expected = pytest.approx([float(each) for each in NUMBER.findall(shown)], abs=0.015)
        assert [float(each) for each in NUMBER.findall(line)] == expected


def first_run(page: Path, printed: str) -> None:
    """The policy is another one, but not the returns that it is compared with."""
    shown = [line for line in block(page, "first run") if not line.startswith("Installed")]
    for line in shown:
        require_line(line, printed, figures=line.startswith(("Best possible", "Uniformly random")))


def score(page: Path, printed: str) -> None:
    for line in block(page, "score"):
        require_line(line, printed, figures=True)


def diagnosis(page: Path, printed: str) -> None:
    (line,) = block(page, "diagnosis")
    require_line(line, printed.splitlines()[0], figures=True)


def comparison(page: Path, printed: str) -> None:
    shown, *_, last = [re.split(r" *\| *", line)[1:-1] for line in block(page, "comparison")]
    (header, *_, row) = [
        re.split(r" *\| *", line)[1:-1] for line in printed.splitlines() if line.startswith("|")
    ]
    assert header == shown
    assert row[:3] == last[:3]  # run, preset, seed


SHOWN: dict[tuple[str, str], tuple[Any, ...]] = {
    ("README.md", "train"): (first_run,),
    ("agents.md", "evaluate reference"): (score,),
    ("commands.md", "diagnose original"): (diagnosis,),
    ("commands.md", "compare runs/original-seed0 runs/reference-seed0"): (comparison,),
}


def test_wrong_answer_prints_the_line_of_the_page(tmp_path: Path, in_process: Command) -> None:
    (tmp_path / "wrong.py").write_text(
        "steps = 0\n\ndef agent(observation):\n    global steps\n    steps += 1\n"
        "    return 2.5 if steps == 3 * 200 + 18 else 0.0\n",
        encoding="utf-8",
    )
    page = (ROOT / "docs" / "agents.md").read_text(encoding="utf-8")
    done = in_process("evaluate", "wrong.py:agent", "--gravity", "10")
    assert (done.returncode, done.stdout) == (2, "")
    assert f"\n    {done.stderr}" in page


def test_page_of_the_files_lists_the_columns_of_the_history() -> None:
    page = (ROOT / "docs" / "files.md").read_text(encoding="utf-8")
    section = page.partition("## The columns of history.csv")[2].partition("\n## ")[0]
    assert re.findall(r"^\| `(\w+)` \|", section, re.MULTILINE) == list(EpisodeRecord._fields)


def test_reference_of_the_api_lists_all_settings_and_fields_of_a_record() -> None:
    source = (ROOT / "docs" / "conf.py").read_text(encoding="utf-8")
    names: dict[str, Any] = {}
    exec(compile(source, "conf.py", "exec"), names)
    lines: list[str] = []
    names["add_settings"](None, "class", "keras_pendulum.Config", kp.Config, None, lines)
    listed = re.findall(r"^:param (\w+): .+ Default: ``", "\n".join(lines), re.MULTILINE)
    assert listed == [field.name for field in fields(kp.Config)]
    page = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    (members,) = re.findall(r"EpisodeRecord\(\)\n   :members: (.*)", page)
    assert members.split(", ") == list(EpisodeRecord._fields)
