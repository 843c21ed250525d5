"""The page as a whole: its networks, its words, its requests."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from browser import WEB, Player, shown
from conftest import wait_for
from page_fixtures import coarse_optimum
from selenium.webdriver.common.by import By

import keras_pendulum as kp
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.figures.curves import PRESET_STYLES, curve_style
from keras_pendulum.page import __main__ as page_command
from keras_pendulum.version import __version__


@pytest.fixture(autouse=True)
def _coarse_optimum(monkeypatch: pytest.MonkeyPatch) -> None:
    coarse_optimum(monkeypatch)


def test_two_networks_run_in_step_from_one_start(
    files: dict[str, Path], duel: str, player: Player
) -> None:
    player.open_paused(duel)
    assert [player.text(f"name-{i}") for i in (0, 1)] == ["one", "two"]
    assert player.text("status") == "Paused. Both networks drive."
    player.press("t")
    assert [player.text(f"name-{i}") for i in (0, 1)] == ["you", "two"]
    player.press("t")
    player.run("pendulum.reset(arguments[0], arguments[1])", *Pendulum().starts([3])[0].tolist())
    player.run("for (let i = 0; i < 200; i++) pendulum.step()")
    scores = [kp.evaluate_policy(files[name], 1, 3) for name in ("one", "two")]
    found = player.run("return pendulum.page.episodes.map(e => e.return)")
    np.testing.assert_allclose(found, [score.mean_return for score in scores], atol=0.02)
    assert player.text("score") == (
        f"Score: one {shown(found[0])} · two {shown(found[1])} · optimum {player.text('optimum')}"
    )
    optimum = player.run("return pendulum.page.optimalReturn")
    assert optimum == pytest.approx(scores[0].optimal_mean_return, abs=0.02)
    assert all(player.find(f"name-{i}").is_displayed() for i in (0, 1))


def test_a_preset_has_the_colour_of_the_other_pictures(
    pages: dict[str, str], duel: str, player: Player
) -> None:
    mark = "getComputedStyle(document.getElementById('name-{}'), '::before').backgroundColor"

    def marks() -> list[str]:
        return [str(player.run(f"return {mark.format(i)}")) for i in (0, 1)]

    player.open_paused(pages["swingup against reference"])
    expected = [
        "rgb({}, {}, {})".format(*bytes.fromhex(curve_style(PRESET_STYLES[name])[0][1:]))
        for name in ("swingup", "reference")
    ]
    assert marks() == expected
    player.press("t")  # the first one is driven by the user
    content = player.run(f"return {mark.format(0)}".replace("backgroundColor", "content"))
    assert content == "none"
    player.open_paused(duel)  # two networks of no preset
    assert marks() == ["rgba(0, 0, 0, 0)"] * 2


def test_names_lines_and_q_values_belong_to_their_network(duel: str, player: Player) -> None:
    player.open_paused(duel)
    assert player.text("values-title") == "Q-values of one"
    strokes = player.driver.find_elements(By.CLASS_NAME, "stroke")
    styles = [stroke.value_of_css_property("border-top-style") for stroke in strokes]
    assert styles == ["solid", "dashed"]  # as the paths on the phase portrait
    player.set_screen(667, 375)
    player.run("pendulum.page.other.return = -1234.56; pendulum.page.changed = true")
    wait_for(lambda: player.text("return-1") == "−1234.6")
    one, other = player.boxes("#system", "#system-1")
    assert one["top"] == other["top"]  # side by side, however many lines a name has


def test_another_gravity_than_in_training_is_said_above_the_pendulum(
    files: dict[str, Path], pages: dict[str, str], user: Player, tmp_path: Path
) -> None:
    assert user.text("swing-title") == "Pendulum"
    user.open(pages["small against swingup"])
    assert user.text("swing-title") == "Pendulum at g = 3.5 m/s², swingup trained at 10"
    out = tmp_path / "page.html"
    assert page_command.main([str(files["small"]), "--gravity", "1", "--out", str(out)]) == 0
    user.open(out.as_uri())
    assert user.text("swing-title") == "Pendulum at g = 1 m/s², trained at 3.5"


def test_page_sends_no_network_requests(pages: dict[str, str], player: Player) -> None:
    player.open(pages["small"])
    wait_for(lambda: player.run("return pendulum.page.map.ready"))
    assert player.run("return performance.getEntriesByType('resource').length") == 0
    log = "".join(entry["message"] for entry in player.log("performance"))
    requested = re.findall(r'"method":"Network.requestWillBeSent".*?"url":"(.*?)"', log)
    # The worker is a part of the page, whose address begins with blob:.
    assert {url for url in requested if not url.startswith("blob:")} == {pages["small"]}
    source = "".join(path.read_text(encoding="utf-8") for path in WEB.rglob("*.*"))
    assert "http" not in re.sub(r'"http-equiv"|http-equiv=', "", source).lower()


@pytest.mark.parametrize("part", ["weights", "table"])
@pytest.mark.parametrize("end", ["first", "last"])
def test_damaged_page_shows_one_line(
    part: str, end: str, pages: dict[str, str], player: Player, tmp_path: Path
) -> None:
    page = Path(pages["small"].removeprefix("file://")).read_text(encoding="utf-8")
    first, last = ("....", "") if end == "first" else ("", "....")
    damaged = re.sub(rf'("{part}": "){first}([^"]+){last}"', r'\1\2"', page)
    (tmp_path / "cut.html").write_text(damaged, encoding="utf-8")
    player.open((tmp_path / "cut.html").as_uri())
    assert re.fullmatch(
        r"This page is damaged \(.+\): write it again with .+\.", player.text("problem")
    )


def test_old_browser_is_told_to_be_too_old(pages: dict[str, str], player: Player) -> None:
    script = {"source": "delete window.DecompressionStream"}
    added = player.driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", script)
    try:
        player.open(pages["small"])
        assert player.text("problem").startswith("This browser is too old for this page")
    finally:
        player.driver.execute_cdp_cmd("Page.removeScriptToEvaluateOnNewDocument", added)


def test_page_describes_its_network(pages: dict[str, str], user: Player) -> None:
    written = f"Written by keras_pendulum {__version__}."
    assert user.text("about") == (
        "<!--<script>&.h5 (preset mine), a 24-7 relu network with 16 torques, on Pendulum-v1 with "
        f"g = 3.5 m/s². Mean return when evaluated: −1234.50. {written}"
    )
    user.open(pages["reference"])
    assert user.text("about").startswith("reference.h5, a 512-256-128 tanh network with 41 torques")
