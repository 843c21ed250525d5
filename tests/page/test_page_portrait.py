"""The phase portrait of the page: its map and its path."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from browser import Player, pixels_of
from conftest import wait_for
from selenium.webdriver.common.keys import Keys

import keras_pendulum as kp
from keras_pendulum.dqn.policy import greedy_policy
from keras_pendulum.environments.actions import TorqueGrid

TIE = 1e-5  # floating-point rounding may change the order of Q-values closer than this


def test_map_shows_the_greedy_torque_of_every_state(
    files: dict[str, Path], pages: dict[str, str], player: Player
) -> None:
    network = kp.load_weights(files["small"])
    policy, grid = greedy_policy(network), TorqueGrid(network.action_count)
    player.open(pages["small"])
    player.press(Keys.SPACE)
    wait_for(lambda: player.run("return pendulum.page.map.ready"))
    size = player.run("return pendulum.page.map.size")
    theta, thetadot = np.meshgrid(np.linspace(-np.pi, np.pi, size), np.linspace(8, -8, size))
    observations = np.stack([np.cos(theta), np.sin(theta), thetadot], axis=-1).astype(np.float32)
    q = policy.q_values(observations.reshape(-1, 3))
    found = np.array(player.run("return Array.from(pendulum.page.map.torques)"))
    taken = q[np.arange(len(q)), [grid.nearest_index(torque) for torque in found]]
    assert (q.max(axis=1) - taken).max() < TIE
    assert len(set(found.tolist())) > 3  # a uniform map would prove nothing

    colours, ends = player.run(
        "const {colours} = pendulum.page.view;"
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
        expected = player.run("return pendulum.page.view.colours.ofTorque(arguments[0])", torque)
        row, column = pixel  # beside the lines of the hatching
        assert expected in picture[row, column - 2 : column + 3].tolist()


def test_clockwise_torques_are_hatched(pages: dict[str, str], player: Player) -> None:
    player.open(pages["small"])
    colours = player.run(
        "const count = (torque) => {"
        "  const map = {size: 97, torques: new Float32Array(97 * 97).fill(torque)};"
        "  const picture = mapPicture(map, pendulum.page.view.colours, 200, 100);"
        "  const {data} = picture.getContext('2d').getImageData(0, 0, 200, 100);"
        "  return new Set(new Uint32Array(data.buffer)).size;"
        "};"
        "return [-2, -0.1, 0, 2].map(count)"
    )
    assert min(colours[:2]) > 1 == max(colours[2:])


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
