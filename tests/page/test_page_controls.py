"""Buttons and keys of the page, its time and its score."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from browser import Player, shown
from conftest import wait_for
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.keys import Keys


def test_switch_takes_over_and_torque_acts_until_the_next_choice(
    pages: dict[str, str], player: Player
) -> None:
    player.open(pages["small"])
    switch = player.find("take-over")
    assert (switch.aria_role, switch.get_attribute("aria-checked")) == ("switch", "false")
    assert player.text("status") == "The network drives."
    switch.click()
    assert switch.get_attribute("aria-checked") == "true"
    assert player.text("status") == "You drive."
    assert player.button(0).get_attribute("aria-pressed") == "true"
    player.press("j")
    start = player.state()["steps"]
    wait_for(lambda: player.state()["steps"] > start + 5)
    assert player.state()["effort"] == -2
    assert player.text("effort") == "−2.00"
    assert player.button(-2).get_attribute("aria-pressed") == "true"
    assert player.button(0).get_attribute("aria-pressed") == "false"
    player.button(2).click()
    wait_for(lambda: player.state()["effort"] == 2)
    player.press("t")
    assert player.text("status") == "The network drives."
    assert player.button(2).get_attribute("aria-pressed") == "false"
    player.press(Keys.SPACE)
    best = player.run("return pendulum.page.episode.network.efforts[pendulum.state().best]")
    player.press("s")
    assert player.state()["effort"] == best
    player.press("t")  # taking over again starts without torque
    assert player.button(0).get_attribute("aria-pressed") == "true"
    player.press("s")
    assert player.state()["effort"] == 0


def test_touching_a_torque_takes_over_at_once(pages: dict[str, str], player: Player) -> None:
    player.set_screen(390, 844)
    player.open(pages["small"])
    finger = ActionChains(player.driver, duration=0)
    finger.move_to_element(player.button(-2)).click_and_hold().perform()
    assert player.text("status") == "You drive."
    assert player.button(-2).get_attribute("aria-pressed") == "true"
    finger.release().perform()
    wait_for(lambda: player.state()["effort"] == -2)


def test_time_runs_at_20_steps_per_second_and_pauses_and_restarts(
    pages: dict[str, str], player: Player
) -> None:
    player.open(pages["small"])
    player.find("pause").click()
    assert player.text("status") == "Paused. The network drives."
    assert player.text("pause").startswith("Play")
    still = player.state()["steps"]
    player.pass_time(1)
    assert player.state()["steps"] == still
    player.find("one-step").click()
    assert player.state()["steps"] == still + 1
    player.find("restart").click()
    wait_for(lambda: player.text("step") == "0/200")
    assert player.text("return") == "0.0"
    assert 39 <= player.pass_time(2, before="pendulum.page.pause()") <= 40
    player.press(Keys.SPACE)  # no clicked button has the focus and takes the key
    assert player.text("status") == "Paused. The network drives."


@pytest.mark.parametrize(
    ("key", "status"), [(" ", "Paused. The network drives."), ("t", "You drive.")]
)
def test_key_that_is_held_acts_once_and_does_not_scroll(
    key: str, status: str, pages: dict[str, str], player: Player
) -> None:
    player.set_screen(844, 390)
    player.open(pages["small"])
    pressed = {"key": key, "text": key, "windowsVirtualKeyCode": ord(key.upper())}
    player.run("addEventListener('keydown', e => { window.prevented = e.defaultPrevented })")
    for repeat in (False, True):
        event = {"type": "keyDown", "autoRepeat": repeat, **pressed}
        player.driver.execute_cdp_cmd("Input.dispatchKeyEvent", event)
        assert key != " " or player.run("return prevented")  # the browser would scroll
    player.driver.execute_cdp_cmd("Input.dispatchKeyEvent", {"type": "keyUp", **pressed})
    assert player.text("status") == status


def test_new_random_start_follows_the_last_step(user: Player) -> None:
    user.run("pendulum.reset(1, 0); for (let i = 0; i < 199; i++) pendulum.step()")
    user.press("t", "s")
    wait_for(lambda: user.text("step") == "200/200")
    total = user.state()["return"]
    assert user.text("score").startswith(f"Score: you and network {shown(total)} · network −")
    starts = []
    for _ in range(20):
        user.run("pendulum.reset(); for (let i = 0; i < 200; i++) pendulum.step()")
        user.press("s")
        starts.append(user.state())
    assert {start["steps"] for start in starts} == {0}
    angles = [start["theta"] for start in starts]
    speeds = [start["thetadot"] for start in starts]
    assert -np.pi <= min(angles) < -1 < 1 < max(angles) <= np.pi
    assert -1 <= min(speeds) < -0.3 < 0.3 < max(speeds) <= 1


def test_score_has_the_network_from_your_start_and_stays_while_time_runs_on(user: Player) -> None:
    begin = "pendulum.reset(1, 0); for (let i = 0; i < 198; i++) pendulum.step()"
    end = "pendulum.page.step(); pendulum.page.step()"
    user.run(begin)
    assert user.text("score") == "The score comes after 200 steps."
    user.run(end)
    network = user.state()["return"]
    user.press("l")
    user.run(f"{begin}; {end}; pendulum.page.running = true")
    you = user.state()["return"]
    assert you < network
    score = user.text("score")
    assert score.startswith(f"Score: you {shown(you)} · network {shown(network)} · ")
    user.pass_time(4)
    assert not user.state()["over"]  # the next episode, after a rest
    assert user.text("score") == score


def test_tab_focuses_every_control_in_order_with_an_outline(
    pages: dict[str, str], player: Player
) -> None:
    player.open(pages["small"])
    order = []
    for _ in range(11):
        player.press(Keys.TAB)
        order.append(player.focus())
        outline = "getComputedStyle(document.activeElement).outline"
        assert "solid 3px" in player.run(f"return {outline}")
    buttons = ["hang", "take-over", "pause", "one-step", "restart", "1", "0", "-1", "0", "2"]
    assert order == ["tab-watch", *buttons]
    player.press(Keys.SPACE)  # the button's own key, not the pause
    assert player.text("status") == "The network drives."
    assert player.run("return pendulum.page.layer") == 2
    player.press(Keys.TAB)
    assert player.focus() == "portrait"
    player.find("take-over").send_keys(Keys.ENTER)
    assert player.text("status") == "You drive."
    player.button(2).send_keys(Keys.SPACE)
    wait_for(lambda: player.state()["effort"] == 2)
    keys = ActionChains(player.driver, duration=0)
    keys.key_down(Keys.CONTROL).send_keys("j").key_up(Keys.CONTROL).perform()
    assert player.button(2).get_attribute("aria-pressed") == "true"  # the browser's own shortcut


def test_score_of_the_last_episode_does_not_stay_beside_another_one(user: Player) -> None:
    first = user.text("score")
    hang: Callable[[], object] = user.find("hang").click
    for act in (lambda: user.press("r"), lambda: user.press("h"), hang):
        user.run("while (!pendulum.page.over) pendulum.step()")
        assert user.text("score").startswith("Score: network ")
        act()
        assert user.text("score") == first


def test_button_hang_starts_where_the_key_does(user: Player) -> None:
    user.find("hang").click()
    assert user.state()["theta"] == pytest.approx(np.pi)
    assert user.state()["thetadot"] == user.state()["steps"] == 0


def test_numbers_that_change_all_the_time_are_no_live_regions(user: Player) -> None:
    live = user.run(
        "return [...document.querySelectorAll("
        "'output, [aria-live]:not([aria-live=off]), [role=status], [role=alert]')].map(e => e.id)"
    )
    texts = "return arguments[0].map(id => document.getElementById(id).textContent)"
    user.run("pendulum.reset(3, 0)")
    before = user.run(texts, live)
    user.run("for (let i = 0; i < 50; i++) pendulum.step()")
    user.redraw()
    assert live
    assert user.run(texts, live) == before
