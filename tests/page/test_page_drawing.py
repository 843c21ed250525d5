"""What the page draws: pendulum, bars and axes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from browser import Player, pixels_of
from numpy.typing import NDArray
from selenium.webdriver.common.keys import Keys

import keras_pendulum as kp
from keras_pendulum.environments.pendulum import Pendulum


@pytest.mark.parametrize("theta", [0.0, 0.8, -2.0, 3.0])
def test_pendulum_points_where_gymnasium_draws_it(
    theta: float, pages: dict[str, str], player: Player
) -> None:
    player.open(pages["small"])
    player.press(Keys.SPACE)
    player.run("pendulum.reset(arguments[0], 0)", theta)
    rod = pixels_of(player, "pendulum", "rod")
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
    lowest = player.run("return pendulum.page.view.floor")
    scale = kp.load_policy("swingup").info.reward_scale
    heights = 1 - (q - q.max()) / scale / lowest
    floor = picture.shape[0] - 38 - 4 - 13  # a bar for the lowest value has 4 px
    np.testing.assert_allclose(1 - (tops + 1) / (floor + 1), heights, atol=0.03)
    value = player.text("best").split(": ")[1].replace("−", "-")
    assert float(value) == pytest.approx(
        q.max() / kp.load_policy("swingup").info.reward_scale, abs=0.01
    )


def test_axis_of_the_bars_is_round_and_stays_while_the_values_fill_it(
    pages: dict[str, str], player: Player
) -> None:
    player.open(pages["small"])

    def floor(lowest: float, before: float | None = None) -> float:
        return float(player.run("return steadyFloor(arguments[0], arguments[1])", lowest, before))

    assert floor(-3.4) == -5
    assert floor(-5) == -5
    assert floor(-13.2) == -20
    assert floor(-0.013) == pytest.approx(-0.02)
    assert floor(-0.51, -5) == -5  # fills a tenth of the axis
    assert floor(-0.49, -5) == -0.5
    assert floor(-5.1, -5) == -10
    assert floor(0) == pytest.approx(-0.001)  # equal values need an axis too


@pytest.mark.parametrize("name", ["reference", "swingup"])
def test_axis_of_the_bars_moves_a_few_times_in_an_episode(
    name: str, pages: dict[str, str], player: Player
) -> None:
    player.open(pages[name])
    player.press(Keys.SPACE)
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
