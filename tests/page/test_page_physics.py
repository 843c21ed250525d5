"""The physics, the networks and the optimum of the page, compared with Gymnasium and Keras."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import Player
from conftest import wait_for
from selenium.webdriver.common.keys import Keys

import keras_pendulum as kp
from keras_pendulum.dqn.policy import greedy_policy
from keras_pendulum.environments.actions import TorqueGrid
from keras_pendulum.environments.pendulum import Pendulum, pendulum_starts

TOLERANCE = 1e-4


TIE = 1e-5  # floating-point rounding may change the order of Q-values closer than this


@pytest.mark.parametrize(("name", "gravity"), [("reference", 1), ("swingup", 10), ("small", 3.5)])
def test_200_steps_agree_with_gymnasium_and_keras(
    name: str, gravity: float, files: dict[str, Path], pages: dict[str, str], player: Player
) -> None:
    network = kp.load_weights(files[name])
    policy, grid = greedy_policy(network), TorqueGrid(network.action_count)
    env = Pendulum(float(gravity)).make_env()
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
    env = Pendulum(3.5).make_env()
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
    wait_for(lambda: player.run("return pendulum.page.layer === 2 && pendulum.page.map.ready"))
    size = player.run("return pendulum.page.map.size")
    found = np.array(player.run("return Array.from(pendulum.page.map.torques)"))
    found = found.reshape(size, size)
    inner = found[1:-1, 1:-1]
    np.testing.assert_allclose(inner, -inner[::-1, ::-1], atol=0.21)  # the mirrored states
    assert abs(found[size // 2, size // 2]) < 0.11
    player.press("m")
    assert player.run("return pendulum.page.layer") == 0
