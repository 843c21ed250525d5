"""What a screen reader and weak eyes need, by the rules of axe."""

from __future__ import annotations

from pathlib import Path

import pytest
from axe_core_python.selenium import Axe
from browser import Player


def violations(player: Player) -> list[str]:
    """Returns the rules that the page breaks, each with the elements."""
    result = Axe().run(player.driver)
    assert len(result["passes"]) > 10
    return [
        f"{each['help']}: {[node['html'] for node in each['nodes']]}"
        for each in result["violations"]
    ]


@pytest.mark.parametrize(("name", "scheme"), [("one against two", "dark"), ("cartpole", "light")])
def test_both_tabs_break_no_rule_of_accessibility(
    name: str, scheme: str, pages: dict[str, str], player: Player
) -> None:
    player.set_screen(390, 844, **{"color-scheme": scheme})
    player.open_paused(pages[name])
    assert violations(player) == []
    player.find("tab-learn").click()
    assert violations(player) == []


def test_lesson_breaks_no_rule_of_accessibility(lesson: Path, player: Player) -> None:
    player.open_paused(lesson.as_uri())
    assert violations(player) == []


def test_missing_name_and_weak_contrast_are_noticed(pages: dict[str, str], player: Player) -> None:
    player.open_paused(pages["one"])
    player.run("document.getElementById('bars').removeAttribute('aria-label')")
    player.run("document.getElementById('score').style.color = '#999'")
    assert len(violations(player)) == 2
