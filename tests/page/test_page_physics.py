"""The physics, the networks and the optimum of the page, compared with the package's own."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit
from urllib.request import url2pathname

import numpy as np
import pytest
from browser import TIE, Player
from conftest import wait_for
from selenium.webdriver.common.keys import Keys

import keras_pendulum as kp
from keras_pendulum.dqn.policy import greedy_policy
from keras_pendulum.environments.actions import TorqueGrid
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.page.training import _encode

TOLERANCE = 1e-4


@pytest.mark.parametrize(("name", "gravity"), [("reference", 1), ("swingup", 10), ("small", 3.5)])
def test_200_steps_agree_with_gymnasium_and_the_policy(
    name: str, gravity: float, files: dict[str, Path], pages: dict[str, str], player: Player
) -> None:
    network = kp.load_weights(files[name])
    policy, grid = greedy_policy(network), TorqueGrid(network.action_count)
    env = Pendulum(float(gravity)).make_env()
    player.open_paused(pages[name])
    ties = 0
    for seed in range(2):
        observation, _ = env.reset(seed=seed)
        pendulum: Any = env.unwrapped
        rows = player.run(
            "pendulum.reset(arguments[0], arguments[1]);"
            "return Array.from({length: 200}, () => {"
            "  const {qValues} = pendulum.state(); pendulum.step();"
            "  return {...pendulum.state(), qValues}; })",
            *pendulum.state.tolist(),
        )
        total = 0.0
        for step, row in enumerate(rows):
            q = policy.q_values(observation)
            np.testing.assert_allclose(row["qValues"], q, rtol=0, atol=TOLERANCE)
            action = int(q.argmax())
            page_action = int(np.abs(grid.torques - row["effort"]).argmin())
            if page_action != action and q[action] - q[page_action] < TIE:
                action, ties = page_action, ties + 1
            observation, reward, _, over, _ = env.step(grid.to_env_action(action))
            total += float(reward)
            found = [row[key] for key in ("theta", "thetadot", "effort", "reward", "return")]
            expected = [*pendulum.state, grid.torques[action], reward, total]
            np.testing.assert_allclose(found, expected, rtol=0, atol=TOLERANCE)
            assert (row["steps"], row["over"]) == (step + 1, over)
        assert player.run("return pendulum.state().over")
    assert ties <= 2


def test_torques_of_keys_act_as_in_gymnasium(user: Player) -> None:
    env = Pendulum(3.5).make_env()
    env.reset(seed=5)
    pendulum: Any = env.unwrapped
    user.run("pendulum.reset(arguments[0], arguments[1])", *pendulum.state.tolist())
    fastest = 0.0
    for key, torque, steps in (
        ("j", -2, 30),
        ("l", 2, 20),
        ("k", 0, 5),
        (Keys.ARROW_LEFT, 2, 60),
        (Keys.ARROW_DOWN, 0, 5),
        (Keys.ARROW_RIGHT, -2, 20),
        (Keys.ARROW_UP, 0, 5),
    ):
        user.press(key, "s" * steps)
        for _ in range(steps):
            _, reward, _, _, _ = env.step(np.array([float(torque)]))
            fastest = max(fastest, abs(pendulum.state[1]))
        state = user.state()
        found = [state[name] for name in ("theta", "thetadot", "effort", "reward")]
        np.testing.assert_allclose(found, [*pendulum.state, torque, reward], atol=TOLERANCE)
        assert user.text("effort") == f"{torque:+.2f}".replace("-", "−").replace("+0", "0")
    assert state["steps"] == 145
    assert fastest == 8  # the pendulum reached the speed limit


@pytest.mark.parametrize(("name", "gravity"), [("reference", 1.0), ("swingup", 10.0)])
def test_optimum_of_a_start_is_the_exact_one(
    name: str, gravity: float, pages: dict[str, str], player: Player
) -> None:
    player.open_paused(pages[name])
    starts = Pendulum().starts(range(60)).tolist()
    found = player.run("return arguments[0].map(s => pendulum.page.optimum.returnFrom(s))", starts)
    shortfall = kp.optimal_return(gravity, range(60)) - found
    assert shortfall.min() > -0.01  # a simulated return cannot be above the optimum
    assert shortfall.mean() < 0.01
    assert shortfall.max() < (0.04 if gravity == 1 else 0.2)


def test_map_switches_to_the_optimum(user: Player) -> None:
    user.press("m")
    wait_for(lambda: user.run("return pendulum.page.layer === 2 && pendulum.page.map.ready"))
    size = user.run("return pendulum.page.map.size")
    found = np.array(user.run("return Array.from(pendulum.page.map.efforts)"))
    found = found.reshape(size, size)
    inner = found[1:-1, 1:-1]
    np.testing.assert_allclose(inner, -inner[::-1, ::-1], atol=0.21)  # the mirrored states
    assert abs(found[size // 2, size // 2]) < 0.11
    user.press("m")
    assert user.run("return pendulum.page.layer") == 0


def test_page_of_twenty_networks_has_at_most_eight_megabytes(
    files: dict[str, Path], pages: dict[str, str]
) -> None:
    network = kp.load_weights(files["reference"])
    arrays = network.get_weights()
    weights = np.concatenate([array.ravel() for array in arrays]).astype(np.float16)
    one = len(json.dumps(_encode(weights, [array.shape for array in arrays])))
    address = pages["swingup"]
    page = Path(url2pathname(urlsplit(address).path)).stat().st_size
    assert page < 1_500_000
    curve = 500 * len("-0.1234, ")
    assert page + 19 * one + curve < 7_950_000  # of 8 MB; a long name needs some space too
