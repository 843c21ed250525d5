"""The command that writes the page. The page itself: test_page.py."""

from __future__ import annotations

import re
import webbrowser
from pathlib import Path

import pytest
from conftest import ROOT, Command, Refusal
from page_fixtures import coarse_optimum

import keras_pendulum as kp
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.page import __main__ as page_command
from keras_pendulum.page.build import build_page

RECORDED = ROOT / "weights" / "original.h5"


@pytest.fixture(autouse=True)
def _coarse_optimum(monkeypatch: pytest.MonkeyPatch) -> None:
    coarse_optimum(monkeypatch)


def test_command_writes_one_file_and_prints_its_address(
    in_process: Command, tmp_path: Path
) -> None:
    out = tmp_path / "pendulum.html"
    assert in_process("page", "reference").returncode == 0
    first_page = out.read_bytes()
    done = in_process("page", "reference", "--gravity", "10")
    assert (done.returncode, done.stderr) == (0, "")
    assert out.read_bytes() != first_page
    size, address = out.stat().st_size, out.resolve().as_uri()
    assert done.stdout == f"Wrote {size / 1e6:.2f} MB; open it in a browser: {address}\n"
    assert [file.name for file in tmp_path.iterdir()] == ["pendulum.html"]
    text = out.read_text(encoding="utf-8")
    assert '"gravity": 10.0, "trainedGravity": 1.0' in text
    assert not re.search(r'(src|href)="', text)


@pytest.mark.parametrize(
    ("evaluated_return", "json"),
    [(-1.5, "-1.5"), (None, "null"), (float("nan"), "null"), (float("-inf"), "null")],
)
def test_page_contains_the_recorded_return_if_it_is_finite(
    evaluated_return: float | None, json: str, tmp_path: Path
) -> None:
    network = kp.DQN((8,))
    kp.save_weights(network, tmp_path / "a.h5", evaluated_return)
    text = build_page(network, tmp_path / "a.h5", Pendulum()).decode()
    assert f'"evaluatedReturn": {json},' in text


WRONG = [
    ([], "the following arguments are required: WEIGHTS.h5"),
    (["missing.h5"], "missing.h5: no such file"),
    (["text.h5"], "text.h5: not an HDF5 file"),
    (["cartpole", "--gravity", "1"], "gravity belongs to Pendulum-v1; CartPole-v1 has none"),
    (["cartpole", "--against", "reference"], "reference.h5: belongs to Pendulum-v1; "),
    ([RECORDED, "--against", "cartpole"], "cartpole.h5: belongs to CartPole-v1; "),
    ([RECORDED, "--against", "missing.h5"], "missing.h5: no such file"),
    ([RECORDED, "--gravity", "nan"], "gravity is nan"),
    ([RECORDED, "--gravity", "heavy"], "invalid float value: 'heavy'"),
    ([RECORDED, "--out", ""], "the name is empty"),
    ([RECORDED, "--out", "text.h5"], "text.h5 holds something else than a page of this command"),
    ([RECORDED, "--out", "no/a.html"], "cannot write no/a.html: there is no folder no"),
    ([RECORDED, "--out", f"{'n' * 500}.html"], "File name too long"),
    ([RECORDED, "--open"], "there is no display for a browser: leave out --open"),
]


@pytest.mark.parametrize(("words", "message"), WRONG, ids=lambda value: str(value)[:60])
def test_mistake_prints_one_line_and_exits_with_status_2(
    words: list[str], message: str, refusal: Refusal, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"):
        monkeypatch.delenv(name, raising=False)
    assert message in refusal(page_command.main, words)


def test_missing_browser_is_refused(refusal: Refusal, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISPLAY", ":0")

    def no_browser(using: str | None = None) -> None:
        raise webbrowser.Error("could not locate runnable browser")

    monkeypatch.setattr(webbrowser, "get", no_browser)
    message = refusal(page_command.main, [RECORDED, "--open"])
    assert message == "error: there is no browser: leave out --open\n"


def test_open_opens_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("BROWSER", "true")
    opened: list[str] = []

    def open_browser(address: str) -> bool:
        opened.append(address)
        return len(opened) == 1

    monkeypatch.setattr(webbrowser, "open", open_browser)
    assert page_command.main([str(RECORDED), "--open"]) == 0
    assert opened == [(tmp_path / "pendulum.html").as_uri()]
    assert page_command.main([str(RECORDED), "--open"]) == 2
    assert capsys.readouterr().err == (
        "error: the browser did not start: open pendulum.html yourself\n"
    )
