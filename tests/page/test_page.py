"""The page in a real browser, compared with Gymnasium and Keras."""

from __future__ import annotations

import json
import os
import re
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from browser import Player, find_chromium, start
from numpy.typing import NDArray
from selenium import webdriver
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.actions.action_builder import ActionBuilder
from selenium.webdriver.common.actions.pointer_input import PointerInput
from selenium.webdriver.common.keys import Keys

import keras_pendulum as kp
from keras_pendulum.dqn.network import Provenance
from keras_pendulum.dqn.policy import greedy_policy
from keras_pendulum.environments.actions import TorqueGrid
from keras_pendulum.environments.tasks import make_environment, pendulum_starts
from keras_pendulum.page import __main__ as page_command
from keras_pendulum.version import __version__

TOLERANCE = 1e-4
TIE = 1e-5  # floating-point rounding may change the order of Q-values closer than this
WEB = Path(page_command.__file__).parent / "web"


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Weights files by name: two shipped ones, and a small one with other sizes and settings."""
    small = kp.DQN(
        (24, 7), 16, activation="relu", provenance=Provenance(gravity=3.5, preset="mine")
    )
    random = np.random.RandomState(0)
    small.set_weights([random.normal(size=w.shape) for w in small.get_weights()])
    path = (
        tmp_path_factory.mktemp("files") / "<!--<script>&.h5"
    )  # characters with a meaning in HTML
    kp.save_weights(small, path)
    return {
        "reference": kp.find_weights("reference"),
        "swingup": kp.find_weights("swingup"),
        "small": path,
    }


@pytest.fixture(scope="module")
def pages(files: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The addresses of the pages of `files`."""
    folder = tmp_path_factory.mktemp("pages")
    for name, path in files.items():
        assert page_command.main([str(path), "--out", str(folder / f"{name}.html")]) == 0
    return {name: (folder / f"{name}.html").as_uri() for name in files}


@pytest.fixture(scope="module")
def chromium() -> Iterator[webdriver.Chrome]:
    """A browser; without one the tests are skipped, but fail in CI."""
    paths = find_chromium()
    if paths is None:
        reason = "no Chromium with its chromedriver here: install chromium and chromium-driver"
        if os.environ.get("CI"):
            pytest.fail(reason, pytrace=False)
        pytest.skip(reason)
    driver = start(*paths)
    yield driver
    driver.quit()


@pytest.fixture
def player(chromium: webdriver.Chrome) -> Iterator[Player]:
    """A user with a large screen; fails when the browser has logged an error."""
    player = Player(chromium)
    player.set_screen(1280, 800)
    player.log("browser")
    player.log("performance")
    yield player
    assert player.log("browser") == []


@pytest.mark.parametrize(("name", "gravity"), [("reference", 1), ("swingup", 10), ("small", 3.5)])
def test_200_steps_agree_with_gymnasium_and_keras(
    name: str, gravity: float, files: dict[str, Path], pages: dict[str, str], player: Player
) -> None:
    network = kp.load_weights(files[name])
    policy, grid = greedy_policy(network), TorqueGrid(network.action_count)
    env = make_environment("Pendulum-v1", float(gravity))
    player.open(pages[name])
    player.press(Keys.SPACE)
    ties = 0
    for seed in range(4):
        observation, _ = env.reset(seed=seed)
        pendulum: Any = env.unwrapped
        rows = player.run(
            "pendulum.reset(arguments[0], arguments[1]);"
            "return Array.from({length: 200}, () => {"
            "  const {qValues} = pendulum.state(); pendulum.step();"
            "  return {...pendulum.state(), qValues}; })",
            *pendulum.state.tolist(),
        )
        total, observations = 0.0, []
        for step, row in enumerate(rows):
            observations.append(observation)
            q = policy.q_values(observation)
            np.testing.assert_allclose(row["qValues"], q, rtol=0, atol=TOLERANCE)
            action = int(q.argmax())
            page_action = grid.nearest_index(row["torque"])
            if page_action != action and q[action] - q[page_action] < TIE:
                action, ties = page_action, ties + 1
            observation, reward, _, over, _ = env.step(grid.to_env_action(action))
            total += float(reward)
            found = [row[key] for key in ("theta", "thetadot", "torque", "reward", "return")]
            expected = [*pendulum.state, grid.torques[action], reward, total]
            np.testing.assert_allclose(found, expected, rtol=0, atol=TOLERANCE)
            assert (row["steps"], row["over"]) == (step + 1, over)
        keras = network(np.array(observations)).numpy()
        found = [row["qValues"] for row in rows]
        np.testing.assert_allclose(found, keras, rtol=0, atol=TOLERANCE)
        assert player.run("return pendulum.state().over")
    assert ties <= 2


def test_torques_of_keys_act_as_in_gymnasium(pages: dict[str, str], player: Player) -> None:
    player.open(pages["small"])
    player.press(Keys.SPACE)
    env = make_environment("Pendulum-v1", 3.5)
    env.reset(seed=5)
    pendulum: Any = env.unwrapped
    player.run("pendulum.reset(arguments[0], arguments[1])", *pendulum.state.tolist())
    fastest = 0.0
    for key, torque, steps in (
        ("j", -2, 30),
        ("l", 2, 20),
        ("k", 0, 5),
        (Keys.ARROW_RIGHT, 2, 60),
        (Keys.ARROW_DOWN, 0, 5),
        (Keys.ARROW_LEFT, -2, 20),
        (Keys.ARROW_UP, 0, 5),
    ):
        player.press(key, "s" * steps)
        for _ in range(steps):
            _, reward, _, _, _ = env.step(np.array([float(torque)]))
            fastest = max(fastest, abs(pendulum.state[1]))
        state = player.state()
        found = [state[name] for name in ("theta", "thetadot", "torque", "reward")]
        np.testing.assert_allclose(found, [*pendulum.state, torque, reward], atol=TOLERANCE)
        assert player.text("torque") == f"{torque:+.2f}".replace("-", "−").replace("+0", "0")
    assert state["steps"] == 145
    assert fastest == 8  # the pendulum reached the speed limit


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
    player.wait(lambda: player.state()["steps"] > start + 5)
    assert player.state()["torque"] == -2
    assert player.text("torque") == "−2.00"
    assert player.button(-2).get_attribute("aria-pressed") == "true"
    assert player.button(0).get_attribute("aria-pressed") == "false"
    player.button(2).click()
    player.wait(lambda: player.state()["torque"] == 2)
    player.press("t")
    assert player.text("status") == "The network drives."
    assert player.button(2).get_attribute("aria-pressed") == "false"
    player.press(Keys.SPACE)
    best = player.run("return pendulum.page.episode.network.torques[pendulum.state().best]")
    player.press("s")
    assert player.state()["torque"] == best
    player.press("t")  # taking over again starts without torque
    assert player.button(0).get_attribute("aria-pressed") == "true"
    player.press("s")
    assert player.state()["torque"] == 0


def test_touching_a_torque_takes_over_at_once(pages: dict[str, str], player: Player) -> None:
    player.set_screen(390, 844)
    player.open(pages["small"])
    finger = ActionChains(player.driver, duration=0)
    finger.move_to_element(player.button(-2)).click_and_hold().perform()
    assert player.text("status") == "You drive."
    assert player.button(-2).get_attribute("aria-pressed") == "true"
    finger.release().perform()
    player.wait(lambda: player.state()["torque"] == -2)


def test_time_runs_at_20_steps_per_second_and_pauses_and_restarts(
    pages: dict[str, str], player: Player
) -> None:
    player.open(pages["small"])
    player.press("r")
    player.wait(lambda: player.state()["steps"] > 0)
    # On a busy machine a single measurement may be too low.
    rates = [steps_per_second(player) for _ in range(3)]
    assert any(rate == pytest.approx(20, rel=0.1) for rate in rates), rates
    player.find("pause").click()
    assert player.text("status") == "Paused. The network drives."
    assert player.text("pause").startswith("Play")
    still = player.state()["steps"]
    time.sleep(0.3)
    assert player.state()["steps"] == still
    player.find("one-step").click()
    assert player.state()["steps"] == still + 1
    player.find("restart").click()
    player.wait(lambda: player.text("step") == "0/200")
    assert player.text("return") == "0.0"
    player.press(Keys.SPACE)  # no clicked button has the focus and takes the key
    player.wait(lambda: player.state()["steps"] > 3)


def steps_per_second(player: Player) -> float:
    count = "return [pendulum.state().steps, performance.now()]"
    first, start = player.run(count)
    player.wait(lambda: player.state()["steps"] >= first + 16)
    last, end = player.run(count)
    return float(1000 * (last - first) / (end - start))


def test_new_random_start_follows_the_last_step(pages: dict[str, str], player: Player) -> None:
    player.open(pages["small"])
    player.press(Keys.SPACE)
    player.run("pendulum.reset(1, 0); for (let i = 0; i < 199; i++) pendulum.step()")
    player.press("t", "s")
    player.wait(lambda: player.text("step") == "200/200")
    total = player.state()["return"]
    assert player.text("score").startswith(f"Score: you and network {shown(total)} · network −")
    starts = []
    for _ in range(20):
        player.run("pendulum.reset(); for (let i = 0; i < 200; i++) pendulum.step()")
        player.press("s")
        starts.append(player.state())
    assert {start["steps"] for start in starts} == {0}
    angles = [start["theta"] for start in starts]
    speeds = [start["thetadot"] for start in starts]
    assert -np.pi <= min(angles) < -1 < 1 < max(angles) <= np.pi
    assert -1 <= min(speeds) < -0.3 < 0.3 < max(speeds) <= 1


def test_score_stays_while_time_runs_on(pages: dict[str, str], player: Player) -> None:
    player.open(pages["small"])
    player.press(Keys.SPACE)
    player.run("pendulum.reset(1, 0); for (let i = 0; i < 198; i++) pendulum.step()")
    assert player.text("score") == "The score comes after 200 steps."
    player.press(Keys.SPACE)
    player.wait(lambda: player.state()["over"])
    score = player.text("score")
    assert score.startswith("Score: network −")
    player.wait(lambda: player.state()["steps"] == 1)  # the next episode, after a rest
    assert player.text("score") == score


def test_score_has_the_network_from_your_start(pages: dict[str, str], player: Player) -> None:
    player.open(pages["small"])
    player.press(Keys.SPACE)
    episode = "pendulum.reset(1, 0); for (let i = 0; i < 200; i++) pendulum.step()"
    player.run(episode)
    network = player.state()["return"]
    player.press("l")
    player.run(episode)
    you = player.state()["return"]
    assert you < network
    assert player.text("score").startswith(f"Score: you {shown(you)} · network {shown(network)} · ")


def shown(total: float) -> str:
    return f"{total:.1f}".replace("-", "−")


def test_tab_focuses_every_control_in_order_with_an_outline(
    pages: dict[str, str], player: Player
) -> None:
    player.open(pages["small"])
    order = []
    for _ in range(9):
        player.press(Keys.TAB)
        order.append(player.focus())
        outline = "getComputedStyle(document.activeElement).outline"
        assert "solid 3px" in player.run(f"return {outline}")
    assert order == ["take-over", "pause", "one-step", "restart", "-2", "0", "2", "0", "2"]
    player.press(Keys.SPACE)  # the button's own key, not the pause
    assert player.text("status") == "The network drives."
    assert player.run("return pendulum.page.layer") == 2
    player.find("take-over").send_keys(Keys.ENTER)
    assert player.text("status") == "You drive."
    player.button(2).send_keys(Keys.SPACE)
    player.wait(lambda: player.state()["torque"] == 2)
    keys = ActionChains(player.driver, duration=0)
    keys.key_down(Keys.CONTROL).send_keys("j").key_up(Keys.CONTROL).perform()
    assert player.button(2).get_attribute("aria-pressed") == "true"  # the browser's own shortcut


def test_page_sends_no_network_requests(pages: dict[str, str], player: Player) -> None:
    player.open(pages["small"])
    player.wait(lambda: player.run("return pendulum.page.map.ready"))
    assert player.run("return performance.getEntriesByType('resource').length") == 0
    log = "".join(entry["message"] for entry in player.log("performance"))
    requested = re.findall(r'"method":"Network.requestWillBeSent".*?"url":"(.*?)"', log)
    assert requested == [pages["small"]]
    assert "http" not in re.sub(r'"http-equiv"|http-equiv=', "", source()).lower()


def source() -> str:
    return "".join(path.read_text(encoding="utf-8") for path in WEB.iterdir())


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_page_fits_every_screen_width(theme: str, pages: dict[str, str], player: Player) -> None:
    colour = {"color-scheme": theme}
    player.set_screen(360, 740, **colour)
    player.open(pages["small"])
    player.press(Keys.SPACE)
    player.run("pendulum.reset(3, -8); pendulum.page.episode.return = -1234.56")
    player.run("for (let i = 0; i < 200; i++) pendulum.step()")  # a last episode of four digits
    player.press("t")
    player.wait(lambda: player.text("score").startswith("Score: network −"))
    for width, height in ((320, 568), (360, 740), (390, 844), (600, 900), (844, 390), (960, 600)):
        player.set_screen(width, height, **colour)
        overhang = "document.documentElement.scrollWidth - document.documentElement.clientWidth"
        assert player.run(f"return [innerWidth, {overhang}]") == [width, 0]
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
        assert low >= 42  # px, plus the border: large enough for a finger
        canvases = player.run(
            "return [...document.querySelectorAll('canvas')].filter(c => c.offsetParent)"
            ".map(c => Math.min(c.clientWidth, c.clientHeight))"
        )
        assert min(canvases) >= 120
    player.set_screen(360, 740, **colour)
    widths = (
        "return [...document.querySelectorAll('canvas')].filter(c => c.offsetParent)"
        ".map(c => c.width / c.clientWidth)"
    )
    player.wait(lambda: set(player.run(widths)) == {2})  # as sharp as the screen
    dark = player.run("return getComputedStyle(document.body).backgroundColor") == "rgb(15, 19, 25)"
    assert dark == (theme == "dark")


@pytest.mark.parametrize("page", ["one", "two"])
@pytest.mark.parametrize(
    ("width", "height", "visible"),
    [
        (1280, 657, ("#swing", "#values", "#phase", ".legend", "#about")),
        (390, 844, ("#pair", "#score", "#phase", ".legend", "#take-over")),
        (844, 390, ("#swing", "#pair", "#readings", "#score", ".torques")),
    ],
)
def test_first_screen_shows_what_belongs_together(
    page: str,
    width: int,
    height: int,
    visible: tuple[str, ...],
    pages: dict[str, str],
    duel: str,
    player: Player,
) -> None:
    player.set_screen(width, height)
    player.open(duel if page == "two" else pages["reference"])
    player.press(Keys.SPACE)
    player.run("pendulum.reset(2, 0); for (let i = 0; i < 200; i++) pendulum.step()")
    for selector in visible:
        top, bottom, wide = player.run(
            "const e = [...document.querySelectorAll(arguments[0])]"
            ".flatMap(e => e.getClientRects().length ? [e] : [...e.children])"
            ".map(e => e.getBoundingClientRect());"
            "return [Math.min(...e.map(r => r.top)), Math.max(...e.map(r => r.bottom)),"
            "  Math.max(...e.map(r => r.width))]",
            selector,
        )
        assert top >= 0 and bottom <= height and wide > 0, selector
    end = player.run("return document.documentElement.scrollHeight")
    if width == 1280:
        assert end <= height  # nothing to scroll to


def test_light_and_dark_theme_have_enough_contrast() -> None:
    text = (WEB / "pendulum.css").read_text(encoding="utf-8")
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
    darker, lighter = sorted(
        float(
            np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
            @ [0.2126, 0.7152, 0.0722]
        )
        for c in (np.frombuffer(bytes.fromhex(x[1:]), np.uint8) / 255 for x in (one, other))
    )
    return (lighter + 0.05) / (darker + 0.05)


def test_page_starts_paused_for_reduced_motion(pages: dict[str, str], player: Player) -> None:
    player.set_screen(1280, 800, **{"reduced-motion": "reduce"})
    player.open(pages["small"])
    assert player.text("status") == "Paused. The network drives."
    assert player.state()["steps"] == 0
    player.press(Keys.SPACE)
    player.wait(lambda: player.state()["steps"] > 2)


@pytest.mark.parametrize("theta", [0.0, 0.8, -2.0, 3.0])
def test_pendulum_points_where_gymnasium_draws_it(
    theta: float, pages: dict[str, str], player: Player
) -> None:
    player.open(pages["small"])
    player.press(Keys.SPACE)
    player.run("pendulum.reset(arguments[0], 0)", theta)
    rod = pixels_of(player, "pendulum", "rod")
    env: Any = make_environment("Pendulum-v1", 1.0, render_mode="rgb_array")
    env.reset(seed=0)
    env.unwrapped.state = np.array([theta, 0.0])
    gymnasium_rod = (env.render() == [204, 77, 77]).all(axis=-1)
    env.close()
    assert direction(rod) == pytest.approx(direction(gymnasium_rod), abs=0.05)


def pixels_of(player: Player, canvas: str, colour: str) -> NDArray[np.bool_]:
    """Returns the mask [rows, columns] of the pixels with a colour of the style sheet."""
    hexadecimal = player.run(f"return pendulum.page.colours.{colour}")
    found = player.picture(canvas)[..., :3] == list(bytes.fromhex(hexadecimal[1:]))
    return np.asarray(found.all(axis=-1))


def direction(mask: NDArray[np.bool_]) -> complex:
    """Returns the unit vector from the centre of a mask to the mean of its marked pixels."""
    rows, columns = np.nonzero(mask)
    middle = complex(columns.mean() - mask.shape[1] / 2, mask.shape[0] / 2 - rows.mean())
    return middle / abs(middle)


@pytest.mark.parametrize(("key", "side"), [("l", 1), ("j", -1)])
def test_arrow_of_a_positive_torque_turns_counter_clockwise(
    key: str, side: int, pages: dict[str, str], player: Player
) -> None:
    player.open(pages["small"])
    player.press(Keys.SPACE)
    player.run("pendulum.reset(0, 0)")
    player.press(key, "s")
    arrow = pixels_of(player, "pendulum", "plus" if side > 0 else "minus")
    # The arrow is below the pivot: its wide head is on the right if it turns counter-clockwise.
    columns = np.nonzero(arrow)[1] - arrow.shape[1] / 2
    assert side * columns.mean() > 1


@pytest.fixture(scope="module")
def duel(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The address of a page with two networks."""
    out = tmp_path_factory.mktemp("duel") / "page.html"
    command = ["reference", "--against", "original", "--out", str(out)]
    assert page_command.main(command) == 0
    assert out.stat().st_size < 2_500_000
    return out.as_uri()


def test_two_networks_run_in_step_from_one_start(duel: str, player: Player) -> None:
    player.open(duel)
    player.press(Keys.SPACE)
    assert [player.text(f"name-{i}") for i in (0, 1)] == ["reference", "original"]
    assert player.text("status") == "Paused. Both networks drive."
    player.press("t")
    assert [player.text(f"name-{i}") for i in (0, 1)] == ["you", "original"]
    player.press("t")
    env = make_environment("Pendulum-v1", 1.0)
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


@pytest.mark.parametrize(("name", "gravity"), [("reference", 1.0), ("swingup", 10.0)])
def test_optimum_of_a_start_is_the_exact_one(
    name: str, gravity: float, pages: dict[str, str], player: Player
) -> None:
    player.open(pages[name])
    player.press(Keys.SPACE)
    starts = pendulum_starts(range(20)).tolist()
    found = player.run(
        "return arguments[0].map(s => pendulum.page.optimum.returnFrom(s[0], s[1]))", starts
    )
    shortfall = kp.optimal_return(gravity, range(20)) - found
    assert shortfall.min() > -0.01  # a simulated return cannot be above the optimum
    assert np.median(shortfall) < 0.05
    assert shortfall.max() < (0.02 if gravity == 1 else 4)


def test_map_switches_to_the_optimum(pages: dict[str, str], player: Player) -> None:
    player.open(pages["reference"])
    player.press(Keys.SPACE, "m")
    player.wait(lambda: player.run("return pendulum.page.layer === 2 && pendulum.page.map.ready"))
    size = player.run("return pendulum.page.map.size")
    found = np.array(player.run("return Array.from(pendulum.page.map.torques)"))
    found = found.reshape(size, size)
    inner = found[1:-1, 1:-1]
    np.testing.assert_allclose(inner, -inner[::-1, ::-1], atol=0.21)  # the mirrored states
    assert abs(found[size // 2, size // 2]) < 0.11
    player.press("m")
    assert player.run("return pendulum.page.layer") == 0


SCREENS = [(1280, 657), (390, 844), (844, 390)]


@pytest.mark.parametrize(("width", "height"), SCREENS)
def test_dragging_turns_the_pendulum_and_starts_an_episode_there(
    width: int, height: int, pages: dict[str, str], player: Player
) -> None:
    player.set_screen(width, height)
    player.open(pages["small"])
    player.press(Keys.SPACE)
    player.run("pendulum.reset(3, 0); pendulum.step()")
    player.run("document.getElementById('pendulum').scrollIntoView({block: 'center'})")
    canvas = player.find("pendulum")
    drag = ActionChains(player.driver, duration=0)
    drag.move_to_element_with_offset(canvas, 0, -60).click_and_hold().perform()
    assert player.state()["theta"] == pytest.approx(0, abs=0.05)
    assert player.run("return pendulum.page.held")
    drag = ActionChains(player.driver, duration=0)
    drag.move_to_element_with_offset(canvas, -60, 0).pause(0.3).release().perform()
    state = player.state()
    assert state["theta"] == pytest.approx(np.pi / 2, abs=0.05)  # on the left is positive
    assert (state["thetadot"], state["steps"], state["return"]) == (0, 0, 0)
    player.wait(lambda: player.text("optimum").startswith("−"))
    player.press("s")
    assert player.state()["steps"] == 1


def test_a_flick_pushes_the_pendulum(pages: dict[str, str], player: Player) -> None:
    player.open(pages["small"])
    player.press(Keys.SPACE)
    canvas = player.find("pendulum")
    flick = ActionChains(player.driver, duration=30)
    flick.move_to_element_with_offset(canvas, 0, -60).click_and_hold()
    flick.move_to_element_with_offset(canvas, -20, -57).release().perform()
    assert 0 < player.state()["thetadot"] <= 8
    speed = (
        "const t = new Touch(() => {}); t.moves = arguments[0]; return t.flickSpeed(arguments[1])"
    )
    assert player.run(speed, [[1, 0], [1.05, 0.1]], 1.06) == pytest.approx(2)
    assert player.run(speed, [[1, 0], [1.05, -1]], 1.06) == -8  # the speed limit
    assert player.run(speed, [[1, 0], [1.05, 0.1]], 2) == 0  # held still before the release


@pytest.mark.parametrize(("width", "height"), SCREENS)
@pytest.mark.parametrize("finger", ["mouse", "touch"])
def test_a_press_on_the_portrait_chooses_the_state(
    finger: str, width: int, height: int, duel: str, player: Player
) -> None:
    player.set_screen(width, height)
    player.open(duel)
    player.press(Keys.SPACE)
    place = player.run(
        "const c = document.getElementById('portrait'); c.scrollIntoView({block: 'center'});"
        "const r = c.getBoundingClientRect();"
        "const [left, right, top, bottom] = portraitEdges(r.width, r.height);"
        "return [r.left + left + 0.75 * (right - left), r.top + top + 0.25 * (bottom - top)]"
    )
    pointer = PointerInput(finger, finger)  # type: ignore[no-untyped-call]
    press = ActionBuilder(player.driver, mouse=pointer, duration=0)
    action: Any = press.pointer_action
    action.move_to_location(*map(round, place)).pointer_down().pointer_up()
    press.perform()
    found = player.run("return pendulum.page.episodes.map(e => [e.theta, e.thetadot])")
    np.testing.assert_allclose(found[0], [np.pi / 2, 4], atol=0.1)
    assert found[0] == found[1]
    player.press("h")
    assert player.run("return pendulum.page.episodes.map(e => e.theta)") == [np.pi, np.pi]


def test_map_shows_the_greedy_torque_of_every_state(
    files: dict[str, Path], pages: dict[str, str], player: Player
) -> None:
    network = kp.load_weights(files["small"])
    policy, grid = greedy_policy(network), TorqueGrid(network.action_count)
    player.open(pages["small"])
    player.press(Keys.SPACE)
    player.wait(lambda: player.run("return pendulum.page.map.ready"))
    size = player.run("return pendulum.page.map.size")
    theta, thetadot = np.meshgrid(np.linspace(-np.pi, np.pi, size), np.linspace(8, -8, size))
    observations = np.stack([np.cos(theta), np.sin(theta), thetadot], axis=-1).astype(np.float32)
    q = policy.q_values(observations.reshape(-1, 3))
    found = np.array(player.run("return Array.from(pendulum.page.map.torques)"))
    taken = q[np.arange(len(q)), [grid.nearest_index(torque) for torque in found]]
    assert (q.max(axis=1) - taken).max() < TIE
    assert len(set(found.tolist())) > 3  # a uniform map would prove nothing

    colours, ends = player.run(
        "const {colours} = pendulum.page;"
        "return [[-2, 0, 2].map(colours.ofTorque), [colours.minus, colours.none, colours.plus]]"
    )
    assert colours == [list(bytes.fromhex(end[1:])) for end in ends]  # the colours of the legend

    player.run("pendulum.reset(Math.PI, 8)")  # moves the path away from the tested points
    picture = player.picture("portrait")[..., :3]
    # The margins of the plot in the picture.
    left, right, top, bottom = 46, picture.shape[1] - 10, 8, picture.shape[0] - 40
    for row, column in ((10, 10), (10, 80), (48, 30), (70, 60), (90, 20), (90, 90)):
        pixel = (
            round(top + row / (size - 1) * (bottom - top)),
            round(left + column / (size - 1) * (right - left)),
        )
        torque = found.reshape(size, size)[row, column]
        expected = player.run("return pendulum.page.colours.ofTorque(arguments[0])", torque)
        assert picture[pixel].tolist() == expected


def test_path_passes_every_state_and_leaves_the_map_only_at_the_edge(
    pages: dict[str, str], player: Player
) -> None:
    player.open(pages["small"])
    player.press(Keys.SPACE)
    player.run("pendulum.reset(2.6, 4)")
    player.press("l", "s" * 12)
    path = np.array(player.run("return pendulum.page.episode.path"))
    assert path[0, 0] < np.pi < path[-1, 0]
    drawn = pixels_of(player, "portrait", "path")
    height, width = drawn.shape
    columns = 46 + ((path[:, 0] + np.pi) % (2 * np.pi) / (2 * np.pi)) * (width - 56)
    rows = 8 + (1 - path[:, 1] / 8) / 2 * (height - 48)
    for row, column in np.rint([rows, columns]).T.astype(int):
        assert drawn[row - 2 : row + 3, column - 2 : column + 3].any()
    # A line from one edge of the picture to the other would cross the middle.
    assert not drawn[:, round(46 + (width - 56) / 2)].any()


def test_every_torque_has_a_bar_and_the_highest_is_the_greedy_one(
    pages: dict[str, str], player: Player
) -> None:
    player.open(pages["swingup"])
    player.press(Keys.SPACE)
    player.run("pendulum.reset(2, 1)")
    state = player.state()
    picture = player.picture("bars")
    left, right = 76, picture.shape[1] - 6
    middles = left + (np.arange(41) + 0.5) * (right - left) / 41
    tops = np.array([np.nonzero(picture[13:, round(m), 3])[0][0] for m in middles])
    q = np.array(state["qValues"])
    assert state["best"] == q.argmax()
    assert tops[state["best"]] == tops.min()  # another bar may have the same height in pixels
    lowest, highest = player.run("return pendulum.page.limits")
    scale = reward_scale(kp.find_weights("swingup"))
    heights = (q / scale - lowest) / (highest - lowest)
    floor = picture.shape[0] - 38 - 4 - 13  # a bar for the lowest value has 4 px
    np.testing.assert_allclose(1 - (tops + 1) / (floor + 1), heights, atol=0.03)
    value = player.text("best").split(": ")[1].replace("−", "-")
    assert float(value) == pytest.approx(
        q.max() / reward_scale(kp.find_weights("swingup")), abs=0.01
    )


def reward_scale(path: Path) -> float:
    """Returns the factor on the rewards in the settings that a weights file records."""
    config = json.loads(kp.load_weights(path).provenance.config or "{}")
    return float(config["reward_scale"])


def test_axis_of_the_bars_is_round_and_stays_while_the_values_fill_it(
    pages: dict[str, str], player: Player
) -> None:
    player.open(pages["small"])

    def limits(low: float, high: float, before: list[float] | None) -> list[float]:
        found: list[float] = player.run(
            "return steadyLimits([arguments[0], arguments[1]], arguments[2])", low, high, before
        )
        return found

    assert limits(-13.2, -2.4, None) == [-15, 0]
    assert limits(-11, -8, [-15, 0]) == [-15, 0]
    assert limits(-11, -8.5, [-15, 0]) == [-11, -8]
    assert limits(-15.1, -2.4, [-15, 0]) == [-20, 0]
    low, high = limits(-1, -1, None)  # equal values need an axis too
    assert low <= -1 <= high and low < high


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
