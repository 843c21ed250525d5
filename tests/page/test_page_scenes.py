"""The lesson of `page --lesson`: its text, and what its scenes do with the page below."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from browser import Player
from conftest import Refusal, wait_for
from selenium.webdriver.common.by import By

from keras_pendulum.page import __main__ as page_command


def test_lesson_is_one_small_file_that_is_readable_without_javascript(lesson: Path) -> None:
    text = lesson.read_text(encoding="utf-8")
    assert len(text.encode()) < 2_500_000
    section = text[text.index('<section id="scenes"') : text.index('<main id="watch"')]
    assert len(re.findall(r"<h2[^>]*>\d\. ", section)) == 5
    assert not re.search(r"<article[^>]* hidden|{{", section)
    words = re.sub(r"<[^>]+>", " ", section).split()
    assert 600 < len(words) < 1000


def test_scenes_set_the_page_to_what_they_speak_of(lesson: Path, player: Player) -> None:
    def scene() -> str:
        titles = player.driver.find_elements(By.CSS_SELECTOR, "#scenes h2")
        (shown,) = [each.text for each in titles if each.is_displayed()]
        return shown[0]

    def go(to: str) -> None:
        player.find(f"scene-{to}").click()
        assert player.run("return document.activeElement.localName") == "h2"

    player.open(lesson.as_uri())
    assert (scene(), player.state()["youDrive"]) == ("1", True)
    assert player.state()["theta"] == pytest.approx(3.14, abs=0.01)
    assert not player.find("scene-back").is_displayed()
    assert player.text("scene-next").split() == ["Next:", "2.", "The", "original", "fails"]
    go("next")
    assert (scene(), player.state()["youDrive"]) == ("2", False)
    assert player.run("return pendulum.page.layer") == 1
    go("next")
    assert scene() == "3"
    wait_for(lambda: player.find("learn").is_displayed())
    assert not player.find("watch").is_displayed()
    assert player.run("return pendulum.lesson.runs.length") == 1
    go("next")
    assert scene() == "4"
    wait_for(lambda: player.run("return pendulum.lesson.choices.faults[0]") == "one-update")
    go("next")
    assert scene() == "5"
    assert player.find("watch").is_displayed()
    assert player.run("return pendulum.page.layer") == 2
    assert not player.find("scene-next").is_displayed()
    go("back")
    assert scene() == "4"
    wait_for(lambda: player.find("learn").is_displayed())


@pytest.mark.parametrize(("width", "height"), [(320, 568), (390, 844), (1280, 800)])
def test_scenes_fit_the_screen(width: int, height: int, lesson: Path, player: Player) -> None:
    player.set_screen(width, height)
    player.open(lesson.as_uri())
    for _ in range(5):
        wide, screen = player.run(
            "return [document.documentElement.scrollWidth, document.documentElement.clientWidth]"
        )
        assert wide <= screen
        if player.find("scene-next").is_displayed():
            player.find("scene-next").click()


def test_lesson_takes_no_other_network(refusal: Refusal) -> None:
    line = "error: --lesson shows `reference` and `original`: it takes only --out and --open\n"
    for words in (["swingup"], ["--against", "swingup"], ["--gravity", "10"]):
        assert refusal(page_command.main, ["--lesson", *words]) == line
