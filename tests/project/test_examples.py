"""The Python examples of README.md, docs and the public docstrings: each runs as it is shown."""

from __future__ import annotations

import doctest
import inspect
import os
import re
from pathlib import Path

import pytest

import keras_pendulum as kp
from benchmarks.pages.blocks import documents

# tests/evaluate/test_agents_page.py runs those of docs/agents.md.
PAGES = [page for page in documents() if page.name != "agents.md"]
EXAMPLES = {
    page: re.findall(r"^```python\n(.*?)^```$", page.read_text("utf-8"), re.MULTILINE | re.DOTALL)
    for page in PAGES
}


@pytest.mark.parametrize(
    "page", [page for page, found in EXAMPLES.items() if found], ids=lambda page: page.name
)
def test_examples_of_a_page_run(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(os, "environ", os.environ.copy())  # an example sets variables
    names: dict[str, object] = {}  # the examples of a page go on from one another
    for example in map(shortened, EXAMPLES[page]):
        if example.startswith(">>>"):
            test = doctest.DocTestParser().get_doctest(example, {}, page.name, None, 0)
            test.globs = names
            require_output(test)
        else:
            exec(compile(example, page.name, "exec"), names)
            if "print(" in example:
                assert capsys.readouterr().out.strip()


def shortened(example: str) -> str:
    """Returns an example with a tenth of its episodes, where they are 100 or more."""
    return re.sub(r"\bepisodes=(\d\d+)0\b", r"episodes=\1", example)


@pytest.mark.parametrize("name", kp.__all__)
def test_examples_of_a_docstring_print_what_they_show(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    value = getattr(kp, name)
    if inspect.isfunction(value):
        assert ">>> " in (value.__doc__ or ""), "a public function has an example"
    for test in doctest.DocTestFinder(recurse=False).find(value, name, globs={"kp": kp}):
        require_output(test)


def require_output(test: doctest.DocTest) -> None:
    """Runs the examples of a text; fails where one prints something else."""
    printed: list[str] = []
    result = doctest.DocTestRunner().run(test, out=printed.append, clear_globs=False)
    assert result.failed == 0, "".join(printed)
