"""The part of the page that learns: its tab, its switches, its workers and its drawings."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest
from browser import Player
from conftest import wait_for
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.optimum.pendulum import PendulumSolution
from keras_pendulum.page.learning import SWITCHES, learning_config

SMALL = "network=8&seed=3"  # a network of 8 units learns as fast as a test needs
CONFIG = learning_config(Pendulum(1.0))


def train(player: Player, **settings: Any) -> Any:
    """Returns what `pendulum.train` resolves to, or the message of its error."""
    player.driver.set_script_timeout(120)
    return player.driver.execute_async_script(
        "const done = arguments[1]; pendulum.train(arguments[0]).then(done, e => done(e.message))",
        settings,
    )


def open_lesson(player: Player, address: str, words: str = SMALL) -> None:
    """Opens the page with a lesson in its address, once the exact values are known."""
    player.driver.get("about:blank")  # the same page with another lesson would not load anew
    player.open(f"{address}#{words}")
    wait_for(lambda: player.run("return Boolean(pendulum.lesson?.exact)"))


@pytest.fixture
def learner(pages: dict[str, str], player: Player) -> Player:
    """A player on a page whose lesson is one small healthy run."""
    open_lesson(player, pages["one"])
    return player


def step(player: Player, episodes: int) -> None:
    """Trains for some episodes by the button, one by one."""
    have = "return pendulum.lesson.runs.every(r => r.records.length === arguments[0])"
    for _ in range(episodes):
        done = player.run("return pendulum.lesson.episode")
        player.find("one-episode").click()
        wait_for(partial(player.run, have, done + 1))


def records(player: Player) -> list[list[dict[str, Any]]]:
    found: list[list[dict[str, Any]]] = player.run(
        "return pendulum.lesson.runs.map(r => r.records)"
    )
    return found


def test_training_repeats_for_a_seed(pages: dict[str, str], player: Player) -> None:
    player.open_paused(pages["one"])
    settings = {"episodes": 44, "hidden_units": [8], "seed": 2}
    first, again = (train(player, **settings) for _ in range(2))
    assert first["updates"] == again["updates"] == 3 * CONFIG.updates_per_episode
    assert first["regret"] == again["regret"] > 0
    other = train(player, **{**settings, "seed": 3})
    assert other["regret"] != first["regret"]
    faulty = train(player, **settings, fault="one-update")
    assert faulty["updates"] == 3


def test_unknown_settings_and_faults_are_refused(pages: dict[str, str], player: Player) -> None:
    player.open_paused(pages["one"])
    assert train(player, gamma=0.9).startswith("unknown setting gamma; expected preset, ")
    assert train(player, fault="no-luck").startswith("unknown fault no-luck; expected one-update, ")


def test_diverged_training_says_so(pages: dict[str, str], player: Player) -> None:
    player.open_paused(pages["one"])
    settings = {"episodes": 45, "hidden_units": [8], "activation": "relu", "learning_rate": 1e200}
    assert train(player, **settings) == "the loss is not finite: learning has diverged"


def test_network_of_the_page_learns_and_one_with_a_fault_does_not(
    pages: dict[str, str], player: Player
) -> None:
    player.open_paused(pages["one"])
    short: dict[str, Any] = {"episodes": 150, "warmup_episodes": 10, "learning_rate": 0.003}
    short |= {"hidden_units": [32, 32], "seed": 1}
    healthy = train(player, **short)
    faulty = train(player, **short, fault="no-bootstrapping")
    assert healthy["updates"] == faulty["updates"] == 140 * CONFIG.updates_per_episode
    assert healthy["regret"] < 60
    assert faulty["regret"] > 300


def test_tabs_are_used_by_keyboard(pages: dict[str, str], player: Player) -> None:
    player.open_paused(pages["one"])
    assert not player.find("learn").is_displayed()
    player.find("tab-watch").send_keys(Keys.ARROW_RIGHT)
    assert player.focus() == "tab-learn"
    assert player.find("learn").is_displayed() and not player.find("watch").is_displayed()
    assert player.find("tab-learn").get_attribute("aria-selected") == "true"
    before = player.state()
    player.driver.find_element(By.TAG_NAME, "body").send_keys("s", "t", "r", Keys.SPACE)
    assert player.state() == before  # the keys of the other part do nothing here
    player.find("tab-learn").send_keys(Keys.HOME)
    assert player.focus() == "tab-watch"
    player.press("s")
    assert player.state()["steps"] == before["steps"] + 1


def test_address_sets_the_lesson(pages: dict[str, str], player: Player) -> None:
    open_lesson(player, pages["one"], "fault=no-target,one-update&seed=7&network=9-8&controls=off")
    assert player.find("learn").is_displayed()
    assert not player.find("choices").is_displayed()
    assert player.find("train").is_displayed()
    healthy, faulty = player.run("return pendulum.lesson.runs.map(r => r.settings)")
    changed = {name for name in healthy if healthy[name] != faulty[name]}
    assert {"target_update", "updates_per_episode"} == changed - {"tau"}
    assert healthy["seed"] == faulty["seed"] == 7
    assert healthy["hidden_units"] == [9, 8]
    open_lesson(player, pages["one"], "fault=no-luck")
    assert player.text("learning-status") == "This page knows no fault no-luck."
    assert player.run("return pendulum.lesson.runs.length") == 1


def test_choices_are_written_into_the_address(learner: Player) -> None:
    for name in SWITCHES:
        assert learner.driver.find_element(By.CSS_SELECTOR, f'#faults [value="{name}"]')
    learner.driver.find_element(By.CSS_SELECTOR, '#faults [value="short-sight"]').click()
    learner.find("another-seed").click()
    assert learner.run("return location.hash") == "#learn&fault=short-sight&seed=4&network=8"
    assert learner.text("fault-text") == SWITCHES["short-sight"].sentence
    learner.run("location.hash = '#fault=far-sight&network=9-9&speed=3'")
    wait_for(lambda: learner.text("fault-text") == SWITCHES["far-sight"].sentence)
    assert learner.run("return pendulum.lesson.runs[1].settings.discount") == 0.999
    assert learner.find("network-size").get_property("value") == "9-9"
    assert learner.find("speed").get_property("value") == "3"


def test_healthy_and_faulty_run_start_alike_and_stay_side_by_side(
    pages: dict[str, str], player: Player
) -> None:
    open_lesson(player, pages["one"], f"fault=reward-sign&{SMALL}")
    step(player, 2)
    one, other = records(player)
    assert [each["episodeReturn"] for each in one] == [each["episodeReturn"] for each in other]
    assert [each["epsilon"] for each in one] == pytest.approx([0.9 * 0.99, 0.9 * 0.99**2])
    player.find("train").click()
    wait_for(lambda: len(records(player)[0]) >= 60)
    player.find("train").click()
    wait_for(lambda: player.text("learning-status") == "Paused.")
    reading = "return document.querySelector('[data-reading=\"episode-1\"]').textContent"
    # The episodes that have begun end after the click, and only then the page is drawn.
    wait_for(lambda: {f"{len(each)}/500" for each in records(player)} == {player.run(reading)})
    one, other = records(player)
    assert one[40]["episodeReturn"] == other[40]["episodeReturn"]  # before the first update
    assert one[45]["episodeReturn"] != other[45]["episodeReturn"]


def test_switch_starts_both_runs_anew_while_they_learn(learner: Player) -> None:
    learner.find("train").click()
    wait_for(lambda: len(records(learner)[0]) >= 5)
    for name in ("no-target", "one-update"):
        learner.driver.find_element(By.CSS_SELECTOR, f'#faults [value="{name}"]').click()
        learner.find("another-seed").click()
    wait_for(lambda: [len(each) >= 5 for each in records(learner)] == [True, True])
    assert learner.run("return pendulum.lesson.runs.map(r => r.settings.seed)") == [5, 5]
    learner.find("train").click()
    wait_for(lambda: learner.text("learning-status") == "Paused.")


def test_screen_readers_are_told_only_the_changes_of_state(learner: Player) -> None:
    live = learner.run(
        "return [...document.querySelectorAll('#learn :is(output, [role=status], [role=alert]),"
        " #learn [aria-live]')].map(e => e.id)"
    )
    assert live == ["learning-status"]
    learner.run(
        "window.told = []; new MutationObserver(() => told.push("
        "  element('learning-status').textContent)).observe(element('learning-status'),"
        "  {childList: true, characterData: true, subtree: true})"
    )
    step(learner, 1)
    learner.find("train").click()
    wait_for(lambda: len(records(learner)[0]) >= 30)
    learner.find("train").click()
    wait_for(lambda: learner.text("learning-status") == "Paused.")
    assert learner.run("return told") == ["Paused.", "Learning.", "Paused."]


def test_exact_values_are_those_of_the_package(learner: Player) -> None:
    states = np.random.RandomState(0).uniform([-np.pi, -6], [np.pi, 6], (200, 2))
    found = np.array(
        learner.run(
            "return arguments[0].map(s => pendulum.lesson.exact.of.value(s))", states.tolist()
        )
    )
    exact = PendulumSolution(Pendulum(1.0))
    table = exact.table(CONFIG.discount)
    torques = np.linspace(-2, 2, 41)
    expected = exact.exact_q(table, CONFIG.discount, states, torques).max(axis=1)
    error = np.abs(found - expected)
    assert np.median(error) < 0.1
    assert error.max() < 1.0
    assert np.ptp(expected) > 50


def test_sweeps_begin_at_zero_and_end_at_the_exact_values(learner: Player) -> None:
    solved = learner.run("return pendulum.lesson.exact.sweeps")
    learner.find("sweep").click()
    wait_for(lambda: learner.run("return pendulum.lesson.swept.sweeps") < solved)
    early = learner.run("return Math.min(...pendulum.lesson.swept.values)")
    exact = learner.run("return Math.min(...pendulum.lesson.exact.values)")
    assert exact < early <= 0
    wait_for(lambda: learner.run("return pendulum.lesson.swept.isSolved"))
    assert learner.run("return pendulum.lesson.swept.sweeps") == solved
    assert learner.run("return Math.min(...pendulum.lesson.swept.values)") == exact


def test_backup_of_a_cell_is_the_equation(pages: dict[str, str], player: Player) -> None:
    open_lesson(player, pages["one"], f"fault=mean-for-maximum&{SMALL}")
    step(player, 1)
    player.find("learned-map-1").send_keys(Keys.ARROW_RIGHT, Keys.ARROW_UP)
    wait_for(
        lambda: player.text("backup-text").startswith("with the fault: θ = −0.39 rad, θ̇ = 1.00")
    )
    state = [-3 * np.pi / 24, 1.0]  # to the right of upright
    script = (
        "const {qValues, targets, exact, best} ="
        " pendulum.lesson.backup(pendulum.lesson.runs[arguments[0]], arguments[1]);"
        "const {weights} = pendulum.lesson.runs[arguments[0]].last;"
        "return [qValues, targets, exact, best, Array.from(weights)]"
    )
    theta, speed = state
    torques = np.linspace(-2, 2, 41)
    rewards = -(theta**2 + 0.1 * speed**2 + 0.001 * torques**2)
    next_speed = speed + 0.05 * (1.5 * np.sin(theta) + 3 * torques)
    next_theta = theta + 0.05 * next_speed

    def q_values(weights: Any, theta: Any, speed: Any) -> Any:
        observation = np.stack([np.cos(theta), np.sin(theta), speed], axis=-1)
        kernel, bias, head, last = np.split(np.array(weights), np.cumsum([24, 8, 328]))
        return np.tanh(observation @ kernel.reshape(3, 8) + bias) @ head.reshape(8, 41) + last

    for run, future in ((0, np.max), (1, np.mean)):
        q, targets, _, best, weights = player.run(script, run, state)
        np.testing.assert_allclose(q, q_values(weights, theta, np.array(speed)), atol=1e-5)
        expected = rewards + 0.9 * future(q_values(weights, next_theta, next_speed), axis=-1)
        np.testing.assert_allclose(targets, expected, atol=1e-5)
        assert best == int(np.argmax(q))


def test_maps_show_the_network_and_where_it_was(learner: Player) -> None:
    step(learner, 1)
    efforts, values, visits, path = learner.run(
        "const { efforts, values, visits, path } = pendulum.lesson.runs[0].last;"
        "return [efforts, values, visits].map(a => Array.from(a)).concat([path])"
    )
    assert sum(visits) == CONFIG.max_episode_steps == len(path) - 1
    cells = {
        (round((1 - speed / 8) * 24), round((((np.pi - theta) % (2 * np.pi)) / np.pi) * 24))
        for theta, speed in path[:-1]
    }
    seen = {divmod(i, 49) for i, count in enumerate(visits) if count}
    assert len(cells ^ seen) <= 2  # a state on the edge of a cell
    found = learner.run(
        "const state = cellState(pendulum.page.task, 49, 10, 30);"
        "return pendulum.lesson.backup(pendulum.lesson.runs[0], state)"
    )
    assert values[10 * 49 + 30] == pytest.approx(max(found["qValues"]), abs=1e-5)
    assert efforts[10 * 49 + 30] == pytest.approx(found["efforts"][found["best"]])
    for layer in ("value", "error", "visits", "effort"):
        learner.driver.find_element(By.CSS_SELECTOR, f'[data-learned-layer="{layer}"]').click()
        wait_for(lambda: learner.find("learned-scale").get_attribute("data-scale") == layer)  # noqa: B023


def test_cartpole_learns_in_the_page(pages: dict[str, str], player: Player) -> None:
    player.open(f"{pages['cartpole']}#fault=no-target&network=8")
    wait_for(lambda: player.run("return Boolean(pendulum.lesson)"))
    step(player, 2)
    assert not player.find("sweep").is_displayed()  # a table on four axes takes too long
    wait_for(lambda: player.run("return Boolean(pendulum.lesson.exact)"))
    values, backup = player.run(
        "const {lesson} = pendulum; const state = [0, 0, ...cellState(lesson.task, 49, 20, 22)];"
        "return [lesson.exact.values[20 * 49 + 22], lesson.backup(lesson.runs[0], state)]"
    )
    assert values == pytest.approx(max(backup["exact"]), abs=0.1)  # by fewer exact steps
    assert 90 < values < 100
    player.driver.find_element(By.CSS_SELECTOR, '[data-learned-layer="error"]').click()
    wait_for(lambda: player.find("learned-scale").get_attribute("data-scale") == "error")
    assert not player.driver.find_elements(By.CSS_SELECTOR, '#faults [value="truncated-index"]')
    one, other = records(player)
    assert one[0]["steps"] == one[0]["episodeReturn"] == other[0]["episodeReturn"] < 500
    assert len(player.run("return pendulum.lesson.runs[0].last.path[0]")) == 4
    player.find("learned-map-0").send_keys(Keys.ARROW_RIGHT)
    wait_for(lambda: player.text("backup-text").startswith("healthy: θ = −0.08 rad"))
    short = {"episodes": 8, "warmup_episodes": 4, "hidden_units": [8]}
    result = train(player, **short)
    assert result["updates"] > 0
    assert 0 < result["regret"] < 500


def test_lesson_fits_every_screen(pages: dict[str, str], player: Player) -> None:
    open_lesson(player, pages["one"], f"fault=no-target&{SMALL}")
    step(player, 1)
    for width, height in ((320, 568), (390, 844), (844, 390), (960, 600), (1280, 800)):
        player.set_screen(width, height)
        wait_for(lambda: player.run("return innerWidth") == width)  # noqa: B023
        cut = player.run(
            "return [...document.querySelectorAll('#learn *, header *')].filter(e =>"
            "  e.getBoundingClientRect().right > document.documentElement.clientWidth ||"
            "  !['canvas', 'select'].includes(e.localName)"
            "  && getComputedStyle(e).display !== 'inline'"
            "  && e.scrollWidth > e.clientWidth + 1).map(e => e.outerHTML)"
        )
        assert cut == [], width
        small = player.run(
            "return [...document.querySelectorAll('#learn :is(button, select, label), [role=tab]')]"
            ".filter(e => e.offsetParent && e.clientHeight < arguments[0]).map(e => e.outerHTML)",
            42 if width < 960 else 32,
        )
        assert small == [], width
