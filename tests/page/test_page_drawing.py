"""What the page draws: pendulum, bars, axes and phase portrait."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import TIE, Player, pixels_of
from conftest import wait_for
from numpy.typing import NDArray
from selenium.webdriver.common.keys import Keys

import keras_pendulum as kp
from keras_pendulum.dqn.policy import greedy_policy
from keras_pendulum.environments.actions import TorqueGrid
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.optimum.pendulum import PendulumSolution


@pytest.mark.parametrize("theta", [0.8, -2.0, 3.0])
def test_pendulum_points_where_gymnasium_draws_it(theta: float, user: Player) -> None:
    user.run("pendulum.reset(arguments[0], 0)", theta)
    rod = pixels_of(user, "system", "rod")
    env: Any = Pendulum().make_env(render_mode="rgb_array")
    env.reset(seed=0)
    env.unwrapped.state = np.array([theta, 0.0])
    gymnasium_rod = (env.render() == [204, 77, 77]).all(axis=-1)
    env.close()
    assert direction(rod) == pytest.approx(direction(gymnasium_rod), abs=0.05)


def direction(mask: NDArray[np.bool_]) -> complex:
    """Returns the unit vector from the centre of a mask to the mean of its marked pixels."""
    rows, columns = np.nonzero(mask)
    middle = complex(columns.mean() - mask.shape[1] / 2, mask.shape[0] / 2 - rows.mean())
    return middle / abs(middle)


@pytest.mark.parametrize(("key", "colour", "side"), [("l", "plus", 1), ("j", "minus", -1)])
def test_arrow_of_a_positive_torque_turns_counter_clockwise(
    key: str, colour: str, side: int, user: Player
) -> None:
    user.run("pendulum.reset(0, 0)")
    user.press(key, "s")
    arrow = pixels_of(user, "system", colour)
    # The arrow is below the pivot: its wide head is on the right if it turns counter-clockwise.
    columns = np.nonzero(arrow)[1] - arrow.shape[1] / 2
    assert side * columns.mean() > 1


def test_every_torque_has_a_bar_from_zero_and_a_mark_at_its_exact_value(
    pages: dict[str, str], player: Player
) -> None:
    player.open_paused(pages["swingup"])
    wait_for(lambda: player.run("return pendulum.page.exact !== null"))
    exact: list[float] = player.run(
        "const {page} = pendulum; page.restart(2, 1); page.drive(true); page.choose(1);"
        "return page.exact.qValues([2, 1], page.episode.network.efforts)"
    )
    policy = kp.load_policy("swingup")
    solution = PendulumSolution(Pendulum(10.0))
    discount = policy.info.discount
    assert discount is not None
    torques = np.linspace(-2, 2, 41)
    table = solution.table(discount)
    expected = solution.exact_q(table, discount, np.array([[2.0, 1.0]]), torques)
    np.testing.assert_allclose(exact, expected[0], atol=0.05 * float(np.ptp(table)))

    path = list(bytes.fromhex(player.run("return pendulum.page.view.colours.path")[1:]))
    for name in ("marks", "bars"):
        picture = player.picture("bars")
        end = player.run("return pendulum.page.view.end")
        seen = (picture[..., :3] == path).all(axis=-1) if name == "marks" else picture[..., 3] > 0
        left, right = 76, picture.shape[1] - 6
        middles = np.round(left + (np.arange(41) + 0.5) * (right - left) / 41).astype(int)
        # The lowest row of each bar or mark, above the axis.
        rows = [np.nonzero(seen[:-39, middle])[0].max() for middle in middles]
        found = (np.array(rows) - 12) / (picture.shape[0] - 38 - 12) * end
        if name == "marks":
            np.testing.assert_allclose(found, exact, atol=0.02 * abs(end))
            player.run("pendulum.page.exact = null")
    state = player.state()
    q = np.array(state["qValues"]) / policy.info.reward_scale
    assert state["best"] == q.argmax()
    np.testing.assert_allclose(found, q, atol=0.02 * abs(end))
    best, worst = re.findall(r"[−\d.]+(?=,|$)", player.text("best"))
    assert float(best.replace("−", "-")) == pytest.approx(q.max(), abs=0.01)
    assert float(worst.replace("−", "-")) == pytest.approx(q.min(), abs=0.01)


def test_axis_of_the_bars_is_round_and_stays_while_the_values_fill_it(user: Player) -> None:

    def end(farthest: float, before: float | None = None) -> float:
        return float(user.run("return steadyEnd(arguments[0], arguments[1])", farthest, before))

    assert end(-3.4) == -5
    assert end(3.4) == 5
    assert end(-5) == -5
    assert end(-13.2) == -20
    assert end(-0.013) == -1  # small values look small
    assert end(-1.01, -5) == -5  # fills a fifth of the axis
    assert end(-0.99, -5) == -5  # 1 is the shortest axis
    assert end(1.5, -5) == 2
    assert end(-5.1, -5) == -10
    assert end(0) == 1


def test_axis_of_the_bars_moves_a_few_times_in_an_episode(
    pages: dict[str, str], player: Player
) -> None:
    player.open_paused(pages["swingup"])
    moves = player.run(
        "const {view, episode} = pendulum.page; let [moves, before] = [0, null];"
        "pendulum.reset(2.5, 0);"
        "for (let i = 0; i < 200; i++) {"
        "  pendulum.step(); view.drawRest();"
        "  moves += view.end !== before; before = view.end;"
        "}"
        "return moves"
    )
    assert 1 <= moves <= 20  # an axis from the lowest to the highest value moved in 50 steps


def test_map_shows_the_greedy_torque_of_every_state(files: dict[str, Path], user: Player) -> None:
    network = kp.load_weights(files["small"])
    policy, grid = greedy_policy(network), TorqueGrid(network.action_count)
    wait_for(lambda: user.run("return pendulum.page.map.ready"))
    size = user.run("return pendulum.page.map.size")
    theta, thetadot = np.meshgrid(np.linspace(np.pi, -np.pi, size), np.linspace(8, -8, size))
    observations = np.stack([np.cos(theta), np.sin(theta), thetadot], axis=-1).astype(np.float32)
    q = policy.q_values(observations.reshape(-1, 3))
    found = np.array(user.run("return Array.from(pendulum.page.map.efforts)"))
    taken = q[np.arange(len(q)), np.abs(found[:, np.newaxis] - grid.torques).argmin(axis=1)]
    assert (q.max(axis=1) - taken).max() < TIE
    assert len(set(found.tolist())) > 3  # a uniform map would prove nothing

    colours, ends = user.run(
        "const {colours} = pendulum.page.view;"
        "return [[-2, 0, 2].map(colours.ofEffort), [colours.minus, colours.none, colours.plus]]"
    )
    assert colours == [list(bytes.fromhex(end[1:])) for end in ends]  # the colours of the legend

    user.run("pendulum.reset(Math.PI, 8)")  # moves the path away from the tested points
    picture = user.picture("portrait")[..., :3]
    # The margins of the plot in the picture.
    left, right, top, bottom = 46, picture.shape[1] - 10, 8, picture.shape[0] - 40
    for row, column in ((10, 10), (10, 80), (48, 30), (70, 60), (90, 20), (90, 90)):
        pixel = (
            round(top + row / (size - 1) * (bottom - top)),
            round(left + column / (size - 1) * (right - left)),
        )
        torque = found.reshape(size, size)[row, column]
        expected = user.run("return pendulum.page.view.colours.ofEffort(arguments[0])", torque)
        row, column = pixel  # beside the lines of the hatching
        assert expected in picture[row, column - 2 : column + 3].tolist()


def test_clockwise_torques_are_hatched(user: Player) -> None:
    colours = user.run(
        "const count = (torque) => {"
        "  const efforts = new Float32Array(97 * 97).fill(torque);"
        "  const picture = mapPicture(efforts, pendulum.page.view.colours, 200, 100);"
        "  const {data} = picture.getContext('2d').getImageData(0, 0, 200, 100);"
        "  return new Set(new Uint32Array(data.buffer)).size;"
        "};"
        "return [-2, -0.1, 0, 2].map(count)"
    )
    assert min(colours[:2]) > 1 == max(colours[2:])


def test_path_passes_every_state_and_leaves_the_map_only_at_the_edge(user: Player) -> None:
    user.run("pendulum.reset(2.6, 4)")
    user.press("l", "s" * 12)
    path = np.array(user.run("return pendulum.page.episode.path"))
    assert path[0, 0] < np.pi < path[-1, 0]
    drawn = pixels_of(user, "portrait", "path")
    height, width = drawn.shape
    columns = 46 + ((np.pi - path[:, 0]) % (2 * np.pi) / (2 * np.pi)) * (width - 56)
    rows = 8 + (1 - path[:, 1] / 8) / 2 * (height - 48)
    for row, column in np.rint([rows, columns]).T.astype(int):
        assert drawn[row - 2 : row + 3, column - 2 : column + 3].any()
    # A line from one edge of the picture to the other would cross the middle.
    assert not drawn[:, round(46 + (width - 56) / 2)].any()


def test_what_leans_to_the_right_is_on_the_right(user: Player) -> None:
    user.run("pendulum.reset(0, 0)")
    user.press(Keys.ARROW_RIGHT, "s" * 8)
    assert user.state()["effort"] == -2  # clockwise
    rod = pixels_of(user, "system", "rod")
    assert np.nonzero(rod)[1].mean() > rod.shape[1] / 2 + 1
    path = pixels_of(user, "portrait", "path")
    assert np.nonzero(path)[1].max() > (46 + path.shape[1] - 10) / 2 + 5
