"""The page as a whole: its networks, its words, its requests."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from browser import WEB, Player, shown
from conftest import wait_for
from page_fixtures import coarse_optimum
from selenium.webdriver.common.keys import Keys

import keras_pendulum as kp
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.page import __main__ as page_command
from keras_pendulum.version import __version__


def test_two_networks_run_in_step_from_one_start(duel: str, player: Player) -> None:
    player.open(duel)
    player.press(Keys.SPACE)
    assert [player.text(f"name-{i}") for i in (0, 1)] == ["reference", "original"]
    assert player.text("status") == "Paused. Both networks drive."
    player.press("t")
    assert [player.text(f"name-{i}") for i in (0, 1)] == ["you", "original"]
    player.press("t")
    env = Pendulum().make_env()
    env.reset(seed=3)
    pendulum: Any = env.unwrapped
    start = pendulum.state.tolist()
    player.run("pendulum.reset(arguments[0], arguments[1])", *start)
    player.run("for (let i = 0; i < 200; i++) pendulum.step()")
    totals = []
    for name in ("reference", "original"):
        score = kp.evaluate_policy(
            kp.load_weights(kp.find_weights(name)), episodes=1, seed=3, gravity=1.0
        )
        totals.append(score.mean_return)
    best = score.optimal_returns[0]
    found = player.run("return pendulum.page.episodes.map(e => e.return)")
    np.testing.assert_allclose(found, totals, atol=0.02)
    assert player.text("score") == (
        f"Score: reference {shown(found[0])} · original {shown(found[1])} · "
        f"optimum {player.text('optimum')}"
    )
    optimum = player.run("return pendulum.page.optimalReturn")
    assert optimum == pytest.approx(best, abs=0.02)
    wide = player.run("return [0, 1].map(i => document.getElementById(`name-${i}`).offsetParent)")
    assert None not in wide


def test_names_lines_and_q_values_belong_to_their_network(duel: str, player: Player) -> None:
    player.open(duel)
    player.press(Keys.SPACE)
    assert player.text("values-title") == "Q-values of reference"
    styles = player.run(
        "return [...document.querySelectorAll('.stroke')]"
        ".map(e => getComputedStyle(e).borderTopStyle)"
    )
    assert styles == ["solid", "dashed"]  # as the paths on the phase portrait
    player.set_screen(667, 375)
    player.run("pendulum.page.other.return = -1234.56; pendulum.page.changed = true")
    wait_for(lambda: player.text("return-1") == "−1234.6")
    tops = player.run(
        "return ['pendulum', 'pendulum-1'].map("
        "  id => document.getElementById(id).getBoundingClientRect().top)"
    )
    assert tops[0] == tops[1]  # the pendulums are side by side, however many lines a name has


def test_another_gravity_than_in_training_is_said_above_the_pendulum(
    player: Player, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    coarse_optimum(monkeypatch)
    out = tmp_path / "page.html"
    for words, title in (
        (["reference", "--gravity", "5"], "Pendulum at g = 5 m/s², trained at 1"),
        (["reference", "--gravity", "1"], "Pendulum"),
        (["reference", "--against", "swingup"], "Pendulum at g = 1 m/s², swingup trained at 10"),
    ):
        assert page_command.main([*words, "--out", str(out)]) == 0
        player.open(out.as_uri())
        assert player.text("swing-title") == title


def test_page_sends_no_network_requests(pages: dict[str, str], player: Player) -> None:
    player.open(pages["small"])
    wait_for(lambda: player.run("return pendulum.page.map.ready"))
    assert player.run("return performance.getEntriesByType('resource').length") == 0
    log = "".join(entry["message"] for entry in player.log("performance"))
    requested = re.findall(r'"method":"Network.requestWillBeSent".*?"url":"(.*?)"', log)
    assert requested == [pages["small"]]
    assert "http" not in re.sub(r'"http-equiv"|http-equiv=', "", source()).lower()


def source() -> str:
    return "".join(path.read_text(encoding="utf-8") for path in WEB.iterdir())


def test_damaged_page_shows_one_line(pages: dict[str, str], player: Player, tmp_path: Path) -> None:
    page = Path(pages["small"].removeprefix("file://")).read_text(encoding="utf-8")
    (tmp_path / "cut.html").write_text(re.sub(r'"weights": "....', '"weights": "', page))
    player.open((tmp_path / "cut.html").as_uri())
    assert re.fullmatch(
        r"This page is damaged \(.+\): write it again with .+\.", player.text("problem")
    )


def test_page_describes_its_network(pages: dict[str, str], player: Player) -> None:
    with h5py.File(kp.find_weights("reference")) as file:
        evaluated = float(file["keras_pendulum"].attrs["evaluated_return"])
    player.open(pages["reference"])
    assert player.text("about") == (
        "reference.h5, a 512-256-128 tanh network with 41 torques, on Pendulum-v1 with g = 1 m/s². "
        f"Mean return when evaluated: −{-evaluated:.2f}. Written by keras_pendulum {__version__}."
    )
    player.open(pages["small"])
    assert player.text("about") == (
        "<!--<script>&.h5 (preset mine), a 24-7 relu network with 16 torques, on Pendulum-v1 with "
        f"g = 3.5 m/s². Written by keras_pendulum {__version__}."
    )
