"""The page of CartPole: physics, network, optimum and controls, compared with the package's own."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import TIE, Player, middle_of
from conftest import wait_for
from selenium.webdriver.common.keys import Keys

import keras_pendulum as kp
from keras_pendulum.dqn.policy import greedy_policy
from keras_pendulum.environments.cartpole import CartPole
from keras_pendulum.optimum.cartpole import CartPoleSolution
from keras_pendulum.optimum.cartpole_dynamics import FORCES, LARGEST_ANGLE
from keras_pendulum.page import __main__ as page_command
from keras_pendulum.storage.recorded_run import load_recorded_run

TOLERANCE = 1e-4


@pytest.fixture
def cartpole(pages: dict[str, str], player: Player) -> Player:
    """A player on the page of the shipped network for CartPole, whose time is paused."""
    player.open_paused(pages["cartpole"])
    return player


def test_an_episode_agrees_with_gymnasium_and_the_policy(cartpole: Player) -> None:
    policy, env = greedy_policy(kp.load_weights("cartpole")), CartPole().make_env()
    observation, _ = env.reset(seed=3)
    inner: Any = env.unwrapped
    cartpole.run("pendulum.reset(...arguments[0])", list(map(float, inner.state)))
    ties = 0
    for step in range(120):
        q = policy.q_values(observation)
        row = cartpole.run(
            "const {qValues} = pendulum.state(); pendulum.step();"
            "return {...pendulum.state(), qValues}"
        )
        np.testing.assert_allclose(row["qValues"], q, rtol=1e-4)
        action = int(row["effort"] > 0)
        ties += action != int(q.argmax())
        assert q.max() - q[action] < TIE
        observation, reward, over, _, _ = env.step(action)
        np.testing.assert_allclose(row["state"], inner.state, atol=TOLERANCE)
        assert (row["reward"], row["return"], row["over"]) == (reward, step + 1, over)
    assert ties <= 2


def test_pushes_of_keys_act_as_in_gymnasium_until_the_pole_falls(cartpole: Player) -> None:
    env = CartPole().make_env()
    env.reset(seed=5)
    inner: Any = env.unwrapped
    cartpole.run("pendulum.reset(...arguments[0])", list(map(float, inner.state)))
    over = False
    for key, actions in (
        ("k", (0, 1, 0, 1)),  # left and right in turn
        ("l", (1, 1)),
        (Keys.ARROW_LEFT, (0, 0, 0)),
        (Keys.ARROW_RIGHT, (1,) * 30),
    ):
        cartpole.press(key)
        for action in actions:
            cartpole.press("s")
            _, _, over, _, _ = env.step(action)
            state = cartpole.state()
            np.testing.assert_allclose(state["state"], inner.state, atol=TOLERANCE)
            assert state["effort"] == FORCES[action]
            assert state["over"] == over
            if over:
                break
    assert over
    steps = cartpole.state()["steps"]
    assert cartpole.text("score").startswith(f"Score: you {steps} · network 500 · optimum 500")


def test_optimum_is_the_exact_one_and_pale_where_all_is_lost(cartpole: Player) -> None:
    exact = CartPoleSolution(CartPole())
    random = np.random.RandomState(0)
    states = random.uniform(-1, 1, (300, 4)) * [2.4, 3, LARGEST_ANGLE, 3]
    found = cartpole.run(
        "const o = pendulum.page.optimum, t = pendulum.page.task;"
        "return arguments[0].map(s => [...o.qValues(s, t.efforts()), o.effort(s)])",
        states.tolist(),
    )
    found = np.array(found)
    q = exact.exact_q(exact.table(0.99), 0.99, states, FORCES)
    np.testing.assert_allclose(found[:, :2], q, atol=0.1)  # float16 and 65 536 levels
    survives = exact.survives(states)
    clear = np.abs(q.max(axis=1) - 90) > 0.2
    np.testing.assert_array_equal(found[clear, 2] != 0, survives[clear])
    sure = clear & survives & (np.abs(q[:, 0] - q[:, 1]) > 0.2)
    assert sure.sum() > 20
    np.testing.assert_array_equal(found[sure, 2], FORCES[q[sure].argmax(axis=1)])
    assert cartpole.run("return pendulum.page.optimum.returnFrom([0.03, 0, -0.02, 0])") == 500


def test_map_follows_the_cart(cartpole: Player) -> None:
    cartpole.press("m")

    def efforts(x: float) -> Any:
        cartpole.run("pendulum.reset(arguments[0], 0, 0, 0); pendulum.page.redraw()", x)
        script = "const {map} = pendulum.page; return map.ready && map.others[0] === arguments[0]"
        wait_for(lambda: cartpole.run(script, x))
        return np.array(cartpole.run("return Array.from(pendulum.page.map.efforts)"))

    assert cartpole.run("return pendulum.page.layer") == 2
    left, middle, right = efforts(-2.3), efforts(0.05), efforts(2.3)
    assert (middle != 0).mean() > 1.2 * (right != 0).mean()  # near the end more is lost
    np.testing.assert_allclose((left == -right[::-1]).mean(), 1, atol=0.02)  # the mirrored states


def test_drag_moves_the_cart_and_a_flick_pushes_the_pole(cartpole: Player) -> None:
    x, y = middle_of(cartpole, "system")
    size = "const {clientWidth: w, clientHeight: h} = document.getElementById('system')"
    width, height = cartpole.run(f"{size}; return [w, h]")
    track = cartpole.run("return pendulum.page.task.track(arguments)", width, height)
    cartpole.run("pendulum.reset(0, 0, 0, 0)")
    top = y - height / 2
    rail, meter = top + track["rail"], track["meter"]
    now = time.time()
    cartpole.mouse("mousePressed", (x, rail - 0.1 * meter), now)
    cartpole.mouse("mouseMoved", (x + meter, rail - 0.1 * meter), now + 1)
    cartpole.mouse("mouseReleased", (x + meter, rail - 0.1 * meter), now + 2)
    wait_for(lambda: not cartpole.run("return pendulum.page.held"))
    state = cartpole.state()["state"]
    np.testing.assert_allclose(state, [1, 0, 0, 0], atol=0.02)
    now += 10
    tip = rail - 1.1 * meter
    cartpole.mouse("mousePressed", (x + meter, tip), now)
    cartpole.mouse("mouseMoved", (x + 1.1 * meter, tip), now + 0.05)
    cartpole.mouse("mouseReleased", (x + 1.1 * meter, tip), now + 0.05)
    wait_for(lambda: not cartpole.run("return pendulum.page.held"))
    position, _, theta, turn = cartpole.state()["state"]
    assert position == pytest.approx(1, abs=0.02)
    assert theta == pytest.approx(np.arctan2(0.1, 1.1 - 0.16), abs=0.02)
    assert 1 < turn <= 3


def test_time_runs_slower_when_you_drive(cartpole: Player) -> None:
    start = "pendulum.reset(0, 0, 0, 0); pendulum.page.running = true"
    assert cartpole.pass_time(1, start) == pytest.approx(50, abs=1)
    assert cartpole.pass_time(1, f"{start}; pendulum.page.choose(0)") == pytest.approx(20, abs=1)


def test_two_networks_of_cartpole_are_driven_from_one_start(
    pages: dict[str, str], player: Player
) -> None:
    player.open_paused(pages["cartpole against cartpole-original"])
    assert player.text("name-1") == "cartpole-original"
    player.press("r", "s" * 3)
    first, second = player.run("return pendulum.page.episodes.map(e => e.path)")
    assert first[0] == second[0]
    assert len(first) == len(second) == 4


def test_page_of_a_run_shows_how_the_network_learned(player: Player, tmp_path: Path) -> None:
    settings = {"episodes": 6, "snapshots": 3, "hidden_units": (16,), "warmup_episodes": 1}
    kp.train_dqn(kp.preset("cartpole", **settings), tmp_path / "run")
    out = tmp_path / "page.html"
    assert page_command.main([str(tmp_path / "run"), "--out", str(out)]) == 0
    player.open_paused(out.as_uri())
    checkpoint = tmp_path / "run" / "cartpole_weight.h5"
    returns = [record.episode_return for record in load_recorded_run(checkpoint).history]
    assert player.text("training-text") == f"episode 6 of 6: return {np.mean(returns):.2f}"
    player.press("p")
    assert player.text("training-text") == (
        f"episode 0 of 6: return {returns[0]:.2f}, no update yet"
    )
