"""The command that writes the page, right and wrong. The page itself: test_page.py."""

from __future__ import annotations

import re
import webbrowser
from pathlib import Path

import pytest
from conftest import DATA, Command, Refusal

import keras_pendulum as kp
from keras_pendulum import page

RECORDED = DATA / "pendulum_weight.keras2.h5"


def test_the_command_writes_one_small_file_and_says_how_to_open_it(
    command: Command, tmp_path: Path
) -> None:
    out = tmp_path / "pendulum.html"
    assert page.main(["reference", "--out", str(out)]) == 0
    older = out.read_bytes()
    done = command("page", "reference", "--gravity", "10")
    assert (done.returncode, done.stderr) == (0, "")
    assert out.read_bytes() != older
    size, address = out.stat().st_size, out.resolve().as_uri()
    assert done.stdout == f"Wrote {size / 1e6:.2f} MB; open it in a browser: {address}\n"
    assert size < 1_500_000
    assert [file.name for file in tmp_path.iterdir()] == ["pendulum.html"]
    text = out.read_text(encoding="utf-8")
    assert '"gravity": 10.0, "trainedGravity": 1.0' in text
    assert not re.search(r'(src|href)="', text)


@pytest.mark.parametrize(
    ("evaluated", "told"),
    [(-1.5, "-1.5"), (None, "null"), (float("nan"), "null"), (float("-inf"), "null")],
)
def test_the_page_tells_the_recorded_return_where_it_is_a_number(
    evaluated: float | None, told: str, tmp_path: Path
) -> None:
    network = kp.DQN((8,))
    kp.save_weights(network, tmp_path / "a.h5", evaluated)
    text = page.page_of(network, tmp_path / "a.h5").decode()
    assert f'"evaluatedReturn": {told},' in text


WRONG = [
    ([], "the following arguments are required: WEIGHTS.h5"),
    (["missing.h5"], "missing.h5: no such file"),
    (["text.h5"], "text.h5: not an HDF5 file"),
    (["n" * 300], "File name too long"),
    (["cartpole"], "belongs to CartPole-v1; the page shows Pendulum-v1"),
    ([RECORDED, "--gravity", "nan"], "gravity is nan"),
    ([RECORDED, "--gravity", "heavy"], "invalid float value: 'heavy'"),
    ([RECORDED, "--out", ""], "the name is empty"),
    ([RECORDED, "--out", "text.h5"], "text.h5 holds something else than a page of ours"),
    ([RECORDED, "--out", "/dev/null"], "/dev/null holds something else than a page of ours"),
    ([RECORDED, "--out", "."], "cannot write ."),
    ([RECORDED, "--out", "no/such/folder.html"], "cannot write no/such/folder.html"),
    ([RECORDED, "--out", "/proc/page.html"], "cannot write /proc/page.html"),
    ([RECORDED, "--out", "n" * 300], "File name too long"),
    ([RECORDED, "--open"], "there is no display to open a browser on"),
]


@pytest.mark.parametrize(("words", "message"), WRONG, ids=lambda value: str(value)[:60])
def test_a_mistake_gets_one_clear_line_and_exit_status_2(
    words: list[str], message: str, refusal: Refusal, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"):
        monkeypatch.delenv(name, raising=False)
    assert message in refusal(page.main, words)


def test_a_browser_that_is_not_there_is_told(
    refusal: Refusal, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DISPLAY", ":0")

    def none(using: str | None = None) -> None:
        raise webbrowser.Error("could not locate runnable browser")

    monkeypatch.setattr(webbrowser, "get", none)
    told = refusal(page.main, [RECORDED, "--open"])
    assert told == "error: there is no browser to open the page with: leave --open out\n"


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
    assert page.main([str(RECORDED), "--open"]) == 0
    assert opened == [(tmp_path / "pendulum.html").as_uri()]
    assert page.main([str(RECORDED), "--open"]) == 2
    assert capsys.readouterr().err == (
        "error: the browser did not start: open pendulum.html by hand\n"
    )
