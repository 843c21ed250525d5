"""What the page draws: pendulum, bars, axes and phase portrait."""

from __future__ import annotations

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


def test_every_torque_has_a_bar_and_the_highest_is_the_greedy_one(
    pages: dict[str, str], player: Player
) -> None:
    player.open_paused(pages["swingup"])
    player.run("pendulum.reset(2, 1)")
    state = player.state()
    picture = player.picture("bars")
    left, right = 76, picture.shape[1] - 6
    middles = left + (np.arange(41) + 0.5) * (right - left) / 41
    tops = np.array([np.nonzero(picture[13:, round(m), 3])[0][0] for m in middles])
    q = np.array(state["qValues"])
    assert state["best"] == q.argmax()
    assert tops[state["best"]] == tops.min()  # another bar may have the same height in pixels
    lowest = player.run("return pendulum.page.view.floor")
    scale = kp.load_policy("swingup").info.reward_scale
    heights = 1 - (q - q.max()) / scale / lowest
    floor = picture.shape[0] - 38 - 4 - 13  # a bar for the lowest value has 4 px
    np.testing.assert_allclose(1 - (tops + 1) / (floor + 1), heights, atol=0.03)
    value = player.text("best").split(": ")[1].replace("−", "-")
    assert float(value) == pytest.approx(
        q.max() / kp.load_policy("swingup").info.reward_scale, abs=0.01
    )


def test_axis_of_the_bars_is_round_and_stays_while_the_values_fill_it(user: Player) -> None:

    def floor(lowest: float, before: float | None = None) -> float:
        return float(user.run("return steadyFloor(arguments[0], arguments[1])", lowest, before))

    assert floor(-3.4) == -5
    assert floor(-5) == -5
    assert floor(-13.2) == -20
    assert floor(-0.013) == pytest.approx(-0.02)
    assert floor(-0.51, -5) == -5  # fills a tenth of the axis
    assert floor(-0.49, -5) == -0.5
    assert floor(-5.1, -5) == -10
    assert floor(0) == pytest.approx(-0.001)  # equal values need an axis too


def test_axis_of_the_bars_moves_a_few_times_in_an_episode(
    pages: dict[str, str], player: Player
) -> None:
    player.open_paused(pages["swingup"])
    moves = player.run(
        "const {view, episode} = pendulum.page; let [moves, before] = [0, null];"
        "pendulum.reset(2.5, 0);"
        "for (let i = 0; i < 200; i++) {"
        "  pendulum.step(); view.drawRest();"
        "  moves += view.floor !== before; before = view.floor;"
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
    taken = q[np.arange(len(q)), [grid.nearest_index(torque) for torque in found]]
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
        "  const map = {size: 97, efforts: new Float32Array(97 * 97).fill(torque)};"
        "  const picture = mapPicture(map, pendulum.page.view.colours, 200, 100);"
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
