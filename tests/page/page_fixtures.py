"""Fixtures of the page: its files, its pages and a user in a browser.

`tests/conftest.py` loads this module for every test, so its fixtures import what they need.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

import keras_pendulum as kp

if TYPE_CHECKING:
    from browser import Player
    from selenium import webdriver

    from keras_pendulum.environments.task import Task


@pytest.fixture(scope="session")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Weights files by name: two shipped ones, and small ones, one with other settings."""
    folder, random = tmp_path_factory.mktemp("files"), np.random.RandomState(0)
    small = kp.DQN((24, 7), 16, activation="relu", metadata={"gravity": 3.5, "preset": "mine"})
    networks = {
        "<!--<script>&.h5": small,  # characters with a meaning in HTML
        "one.h5": kp.DQN((24,), metadata={"gravity": 1.0}),
        "two.h5": kp.DQN((16, 8), metadata={"gravity": 1.0}),
    }
    for name, network in networks.items():
        network.set_weights([random.normal(size=w.shape) for w in network.get_weights()])
        kp.save_weights(network, folder / name, -1234.5)
    return {
        "reference": kp.find_weights("reference"),
        "swingup": kp.find_weights("swingup"),
        "cartpole": kp.find_weights("cartpole"),
        "cartpole-original": kp.find_weights("cartpole-original"),
        "small": folder / "<!--<script>&.h5",
        "one": folder / "one.h5",
        "two": folder / "two.h5",
    }


def coarse_optimum(monkeypatch: pytest.MonkeyPatch) -> None:
    """Makes an optimum that the package does not have coarse, which is much faster."""
    from keras_pendulum.optimum.episode_values import EpisodeValues, episode_values, solve_episode
    from keras_pendulum.page import build, learning
    from keras_pendulum.page.learning import highest_return

    def values(gravity: float) -> EpisodeValues:
        return episode_values(gravity) if gravity in (1, 10) else solve_episode(gravity, 26)

    def highest(task: Task) -> float:
        return highest_return(task) if task.gravity in (None, 1, 10) else 0.0

    monkeypatch.setattr(build, "episode_values", values)
    monkeypatch.setattr(learning, "highest_return", highest)


class _Pages(dict[str, str]):
    """The addresses of pages by name; a page is written when it is used for the first time."""

    def __init__(self, files: dict[str, Path], folder: Path) -> None:
        self._files, self._folder = files, folder

    def __missing__(self, name: str) -> str:
        from keras_pendulum.page import __main__ as page_command

        out = self._folder / f"{name}.html"
        first, _, second = name.partition(" against ")
        against = ["--against", str(self._files[second])] if second else []
        with pytest.MonkeyPatch.context() as patched:
            coarse_optimum(patched)
            assert page_command.main([str(self._files[first]), *against, "--out", str(out)]) == 0
        self[name] = out.as_uri()
        return self[name]


@pytest.fixture(scope="session")
def pages(files: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The addresses of the pages of `files`, and of pairs such as `one against two`."""
    return _Pages(files, tmp_path_factory.mktemp("pages"))


@pytest.fixture(scope="session")
def lesson(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file that `page --lesson` writes."""
    from keras_pendulum.page import __main__ as page_command

    out = tmp_path_factory.mktemp("lesson") / "lesson.html"
    assert page_command.main(["--lesson", "--out", str(out)]) == 0
    return out


@pytest.fixture
def duel(pages: dict[str, str]) -> str:
    """The address of a page with two networks."""
    return pages["one against two"]


@pytest.fixture(scope="session")
def chromium() -> Iterator[webdriver.Chrome]:
    """A browser; without one the tests are skipped, but fail in CI."""
    from browser import find_chromium, start

    paths = find_chromium()
    if paths is None:
        reason = "no Chromium with its chromedriver here: install chromium and chromium-driver"
        if os.environ.get("CI"):
            pytest.fail(reason, pytrace=False)
        pytest.skip(reason)
    driver = start(*paths)
    yield driver
    driver.quit()


@contextlib.contextmanager
def large_screen(chromium: webdriver.Chrome) -> Iterator[Player]:
    """A user with a large screen; fails at the end when the browser has logged an error."""
    from browser import Player

    player = Player(chromium)
    player.set_screen(1280, 800)
    player.log("browser")
    player.log("performance")
    yield player
    errors = player.log("browser")
    chromium.get("about:blank")  # an open page goes on drawing, which slows other tests
    assert errors == []


@pytest.fixture
def player(chromium: webdriver.Chrome) -> Iterator[Player]:
    """A user with a large screen; fails when the browser has logged an error."""
    with large_screen(chromium) as player:
        yield player


@pytest.fixture
def user(pages: dict[str, str], player: Player) -> Player:
    """A player on the page of the small network, whose time is paused."""
    player.open_paused(pages["small"])
    return player
