"""The page on screens of several sizes, in light and dark."""

from __future__ import annotations

import re
from itertools import pairwise

import numpy as np
import pytest
from browser import SCREENS, WEB, Player
from conftest import wait_for
from matplotlib.colors import to_rgb
from selenium.webdriver.common.by import By


@pytest.mark.parametrize("name", ["small", "cartpole"])
def test_page_fits_every_screen_width(name: str, pages: dict[str, str], player: Player) -> None:
    player.set_screen(360, 740)
    player.open_paused(pages[name])
    if name == "small":
        player.run("pendulum.reset(3, -8); pendulum.page.episode.return = -1234.56")
    else:
        player.run("pendulum.reset(-2.35, 0.5, 0.2, -2)")
    # A last episode of four digits.
    player.run("do pendulum.step(); while (!pendulum.page.over)")
    player.press("t")
    wait_for(lambda: player.text("score").startswith("Score: network "))
    for width, height in ((320, 568), (360, 740), (390, 844), (600, 900), (844, 390), (960, 600)):
        player.set_screen(width, height)
        root = player.driver.find_element(By.TAG_NAME, "html")
        assert player.run("return innerWidth") == width
        assert root.get_property("scrollWidth") == root.get_property("clientWidth")
        cut = player.run(
            "return [...document.querySelectorAll('main *')].filter(e =>"
            "  e.getBoundingClientRect().right > document.documentElement.clientWidth ||"
            "  e.localName !== 'canvas' && getComputedStyle(e).display !== 'inline' &&"
            "  e.scrollWidth > e.clientWidth + 1"
            ").map(e => e.outerHTML)"
        )
        assert cut == [], width
        low = player.run(
            "return Math.min(...[...document.querySelectorAll('button')]"
            ".filter(e => e.offsetParent).map(e => e.clientHeight))"
        )
        assert low >= (42 if width < 960 else 32)  # px: large enough for a finger, or for a mouse
        canvases = player.run(
            "return [...document.querySelectorAll('canvas')].filter(c => c.offsetParent)"
            ".map(c => Math.min(c.clientWidth, c.clientHeight))"
        )
        assert min(canvases) >= 120
    player.set_screen(360, 740)
    widths = (
        "return [...document.querySelectorAll('canvas')].filter(c => c.offsetParent)"
        ".map(c => c.width / c.clientWidth)"
    )
    wait_for(lambda: set(player.run(widths)) == {2})  # as sharp as the screen


def test_page_is_light_or_dark_as_the_system(user: Player) -> None:
    for theme, colour in (("dark", "rgb(15, 19, 25)"), ("light", "rgb(243, 245, 248)")):
        user.set_screen(1280, 800, **{"color-scheme": theme})
        found = user.run("return getComputedStyle(document.body).backgroundColor")
        assert found == colour


def test_widest_readings_do_not_touch(duel: str, player: Player) -> None:
    player.open_paused(duel)
    # Each new part of the map would write the readings anew.
    player.run("pendulum.page.map.work(60000); pendulum.page.changeMap()")
    widest = {"effort": "−2.0", "reward": "−16.27", "return": "−1848.8", "step": "200/200"}
    widest |= {"theta": "−3.14", "thetadot": "−8.00", "optimum": "−1234.5"}
    for width, height in (*SCREENS, (1216, 700), (1024, 768), (667, 375), (320, 568)):
        player.set_screen(width, height)
        player.redraw()
        boxes = player.run(
            "for (const [id, text] of Object.entries(arguments[0])) element(id).textContent = text;"
            "return [...document.querySelectorAll('dt, dd')].map(e => {"
            "  const range = document.createRange();"
            "  range.selectNodeContents(e);"
            "  const { left, right, top } = range.getBoundingClientRect();"
            "  return [Math.round(top), left, right, e.textContent]"
            "})",
            widest,
        )
        assert len(boxes) == 14
        assert {box[3] for box in boxes} >= set(widest.values())
        for (top, _, right, text), (next_top, left, _, next_text) in pairwise(sorted(boxes)):
            assert top != next_top or left - right >= 8, (width, text, next_text)


def test_keys_of_buttons_are_in_one_line(user: Player) -> None:
    for width in (960, 1024, 1152, 1280, 1600):
        user.set_screen(width, 700)
        heights = user.run(
            "return [...document.querySelectorAll('.row button')].map(e => e.clientHeight)"
        )
        assert max(heights) < 40, width


# What one sees without scrolling, by the size of the screen.
FIRST_SCREEN = {
    (1280, 657): ("#swing", "#values", "#phase", ".legend", "#about"),
    (390, 844): ("#pair", "#score", "#phase", ".legend", "#take-over"),
    (844, 390): ("#swing", "#pair", "#readings", "#score", ".torques"),
}


@pytest.mark.parametrize("page", ["one", "two"])
def test_first_screen_shows_what_belongs_together(
    page: str, pages: dict[str, str], duel: str, player: Player
) -> None:
    player.open_paused(duel if page == "two" else pages["small"])
    player.run("pendulum.reset(2, 0); for (let i = 0; i < 200; i++) pendulum.step()")
    for (width, height), visible in FIRST_SCREEN.items():
        player.set_screen(width, height)
        player.redraw()
        for selector in visible:
            top, bottom, wide = player.run(
                "const e = [...document.querySelectorAll(arguments[0])]"
                ".flatMap(e => e.getClientRects().length ? [e] : [...e.children])"
                ".map(e => e.getBoundingClientRect());"
                "return [Math.min(...e.map(r => r.top)), Math.max(...e.map(r => r.bottom)),"
                "  Math.max(...e.map(r => r.width))]",
                selector,
            )
            assert top >= 0 and bottom <= height and wide > 0, (width, selector)
        if width == 1280:
            # Nothing to scroll to, and no empty strip below the words.
            assert player.run("return document.documentElement.scrollHeight") <= height
            assert player.boxes("footer")[0]["bottom"] >= height - 20
            (canvas,) = player.boxes("#system")
            # The circle of the end of a pendulum, less the margins of drawing.js.
            assert min(canvas["width"] - 28, canvas["height"] - 56) >= 210


def test_light_and_dark_theme_have_enough_contrast() -> None:
    text = (WEB / "colours.css").read_text(encoding="utf-8")
    light, dark = (
        dict(re.findall(r"--(\w+): (#\w{6})", block))
        for block in re.findall(r":root {(.*?)}", text, re.S)
    )
    assert light.keys() == dark.keys()
    for colours in (light, dark):
        for ink in ("ink", "soft", "accent", "problem"):
            for ground in ("card", "paper"):
                assert contrast(colours[ink], colours[ground]) >= 4.5  # WCAG 2.2, level AA
        for mark in ("minus", "plus", "rod"):
            assert contrast(colours[mark], colours["card"]) >= 3


def contrast(one: str, other: str) -> float:
    """Returns the contrast ratio of two colours, #rrggbb (WCAG 2.2)."""
    darker, lighter = sorted(map(luminance, (one, other)))
    return (lighter + 0.05) / (darker + 0.05)


def luminance(colour: str) -> float:
    c = np.array(to_rgb(colour))
    linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


@pytest.mark.parametrize("name", ["small", "cartpole"])
def test_large_zoom_has_the_page_in_one_column(
    name: str, pages: dict[str, str], player: Player
) -> None:
    player.open_paused(pages[name])
    # A desktop's window of 1366 × 657 at a zoom of 200 %, and of 1280 × 800 at one of 250 %.
    for width, height in ((683, 328), (512, 320)):
        sides = {}
        for touch in (True, False):
            player.set_screen(width, height, touch)
            player.redraw()
            pair, readings = player.boxes("#pair", "#readings")
            sides[touch] = readings["top"] < pair["bottom"]
            letters = player.run(
                "return [...document.querySelectorAll('#readings *')]"
                ".map(e => parseFloat(getComputedStyle(e).fontSize))"
            )
            assert touch or min(letters) >= 12
        assert sides == {True: width > 576, False: False}
