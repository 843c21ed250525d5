"""Drags, flicks and presses on the page, with a mouse, a finger and keys."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from browser import SCREENS, Player, middle_of
from conftest import wait_for
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.actions.action_builder import ActionBuilder
from selenium.webdriver.common.actions.pointer_input import PointerInput
from selenium.webdriver.common.keys import Keys


def test_dragging_turns_the_pendulum_and_starts_an_episode_there(user: Player) -> None:
    user.run("pendulum.reset(3, 0); pendulum.step()")
    canvas = user.find("system")
    drag = ActionChains(user.driver, duration=0)
    drag.move_to_element_with_offset(canvas, 0, -60).click_and_hold().perform()
    assert user.state()["theta"] == pytest.approx(0, abs=0.05)
    assert user.run("return pendulum.page.held")
    drag = ActionChains(user.driver, duration=0)
    drag.move_to_element_with_offset(canvas, -60, 0).pause(0.3).release().perform()
    state = user.state()
    assert state["theta"] == pytest.approx(np.pi / 2, abs=0.05)  # on the left is positive
    assert (state["thetadot"], state["steps"], state["return"]) == (0, 0, 0)
    wait_for(lambda: user.text("optimum").startswith("−"))
    user.press("s")
    assert user.state()["steps"] == 1


def test_a_flick_pushes_the_pendulum(user: Player) -> None:
    x, y = middle_of(user, "system")
    now = time.time()
    user.mouse("mousePressed", (x, y - 60), now)
    user.mouse("mouseMoved", (x - 20, y - 57), now + 0.03)
    user.mouse("mouseReleased", (x - 20, y - 57), now + 0.03)
    wait_for(lambda: not user.run("return pendulum.page.held"))
    assert 0 < user.state()["thetadot"] <= 8
    speed = (
        "const t = new Touch(() => {}); t.moves = arguments[0]; return t.flickSpeed(arguments[1])"
    )
    assert user.run(speed, [[1, 0], [1.05, 0.1]], 1.06) == pytest.approx(2)
    assert user.run(speed, [[1, 0], [1.05, -1]], 1.06) == pytest.approx(-20)
    assert user.run(speed, [[1, 0], [1.05, 0.1]], 2) == 0  # held still before the release
    now += 10
    user.mouse("mousePressed", (x, y - 60), now)
    user.mouse("mouseMoved", (x - 60, y), now + 0.01)
    user.mouse("mouseReleased", (x - 60, y), now + 0.01)
    wait_for(lambda: not user.run("return pendulum.page.held"))
    assert user.state()["thetadot"] == 8  # the speed limit


@pytest.mark.parametrize(("width", "height"), SCREENS)
def test_a_press_and_a_drag_on_the_portrait_choose_the_state(
    width: int, height: int, duel: str, player: Player
) -> None:
    finger = "mouse" if width == 1280 else "touch"
    player.open_paused(duel)
    player.set_screen(width, height)
    for places in ([0.75], [0.5, 0.75]):
        from_middle = player.run(
            "const c = document.getElementById('portrait'); c.scrollIntoView({block: 'center'});"
            "const {width, height} = c.getBoundingClientRect();"
            "const [left, right, top, bottom] = portraitEdges(width, height);"
            "return arguments[0].map(x => [(1 - x) * left + x * right - width / 2,"
            "  x * top + (1 - x) * bottom - height / 2])",
            places,
        )
        pointer = PointerInput(finger, finger)
        actions = ActionBuilder(player.driver, mouse=pointer, duration=0)
        action: Any = actions.pointer_action
        portrait = player.find("portrait")
        action.move_to(portrait, *map(round, from_middle[0])).pointer_down()
        for place in from_middle[1:]:
            action.move_to(portrait, *map(round, place))
        action.pointer_up()
        actions.perform()
        wait_for(lambda: not player.run("return pendulum.page.held"))
        found = player.run("return pendulum.page.episodes.map(e => e.state)")
        np.testing.assert_allclose(found[0], [-np.pi / 2, 4], atol=0.1)
        assert found[0] == found[1]
        player.press("h")
        assert player.run("return pendulum.page.episodes.map(e => e.state[0])") == [np.pi, np.pi]


@pytest.fixture
def fingers(player: Player) -> Iterator[Player]:
    """A user with a touch screen."""
    player.driver.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": True})
    yield player
    player.driver.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": False})


@pytest.mark.parametrize(("width", "height"), SCREENS)
def test_a_finger_turns_and_flicks_the_pendulum(
    width: int, height: int, pages: dict[str, str], fingers: Player
) -> None:
    player = fingers
    player.set_screen(width, height)
    player.open_paused(pages["small"])
    x, y = middle_of(player, "system")
    scrolled = player.run("return scrollY")
    now = time.time()
    player.finger("touchStart", (x, y - 50), now)
    player.finger("touchMove", (x - 50, y), now + 1)
    wait_for(lambda: player.run("return pendulum.page.held"))
    player.finger("touchMove", (x, y + 50), now + 2)
    player.finger("touchEnd", (x, y + 50), now + 3)
    wait_for(lambda: not player.run("return pendulum.page.held"))
    state = player.state()
    assert np.cos(state["theta"]) == pytest.approx(-1, abs=0.002)
    assert (state["thetadot"], state["steps"]) == (0, 0)  # held still before the release
    assert player.run("return scrollY") == scrolled  # the finger did not move the page
    now += 10
    player.finger("touchStart", (x, y - 50), now)
    for i in range(1, 6):
        player.finger("touchMove", (x - 4 * i, y - 50), now + 0.016 * i)
    player.finger("touchEnd", (x - 20, y - 50), now + 0.09)
    wait_for(lambda: not player.run("return pendulum.page.held"))
    turned = player.state()["theta"] - np.arctan2(20, 50)
    assert np.sin(turned / 2) == pytest.approx(0, abs=0.025)  # whole turns do not matter
    assert 2 < player.state()["thetadot"] <= 8


def test_arrows_on_the_focused_portrait_choose_any_state(user: Player) -> None:
    user.run("pendulum.reset(0.52, 0); document.getElementById('portrait').focus()")
    user.press(Keys.ARROW_RIGHT, Keys.ARROW_UP, Keys.ARROW_UP)
    state = user.state()
    assert [state["theta"], state["thetadot"]] == pytest.approx([0.4, 1.0])
    assert user.text("status") == "Held at 0.40 rad, 1.00 rad/s. Enter lets go."
    assert not state["youDrive"]
    fine = ActionChains(user.driver, duration=0)
    fine.key_down(Keys.SHIFT).send_keys(Keys.ARROW_LEFT, Keys.ARROW_DOWN).key_up(Keys.SHIFT)
    fine.perform()
    user.press(Keys.ENTER)
    assert not user.run("return pendulum.page.held")
    state = user.state()
    assert [state["theta"], state["thetadot"], state["steps"]] == pytest.approx([0.41, 0.9, 0])
    user.press(*[Keys.ARROW_LEFT] * 40, *[Keys.ARROW_DOWN] * 20)
    state = user.state()
    assert state["theta"] == pytest.approx(0.4 + 40 * 0.1 - 2 * np.pi, abs=0.11)  # once around
    assert state["thetadot"] == -8
    user.press(Keys.TAB)  # leaving the portrait lets go too
    assert not user.run("return pendulum.page.held")
    assert user.text("status") == "Paused. The network drives."
