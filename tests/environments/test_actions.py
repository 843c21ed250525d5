"""The actions: indices, and the torques that they stand for."""

from __future__ import annotations

import numpy as np
import pytest

from keras_pendulum.environments.actions import (
    Actions,
    TorqueGrid,
    TruncatingTorqueGrid,
    torque_actions,
    truncated_index,
)
from keras_pendulum.environments.cartpole import CartPole
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.environments.task import Task
from keras_pendulum.errors import ConfigError


def test_grid_is_the_linspace_of_the_original() -> None:
    grid = TorqueGrid(41)
    np.testing.assert_array_equal(grid.torques, np.linspace(-2, 2, 41))
    assert grid.count == 41


def test_environment_gets_a_float64_torque_of_shape_1() -> None:
    torque = TorqueGrid(41).to_env_action(3)
    assert torque.shape == (1,)
    assert torque.dtype == np.float64
    assert torque[0] == pytest.approx(-1.7)


def test_stored_index_is_the_index() -> None:
    assert [TorqueGrid(5).stored_index(index) for index in range(5)] == list(range(5))


def test_truncating_grid_has_the_torques_of_the_walkthrough() -> None:
    grid = TruncatingTorqueGrid()
    assert [grid.to_env_action(index).item() for index in range(41)] == [
        index / 10 - 2 for index in range(41)
    ]


def test_truncating_grid_stores_index_2_as_1_and_4_as_3() -> None:
    grid = TruncatingTorqueGrid()
    stored = [grid.stored_index(index) for index in range(41)]
    assert {index: other for index, other in enumerate(stored) if other != index} == {2: 1, 4: 3}
    assert stored == [truncated_index(float(torque)) for torque in grid.torques]


@pytest.mark.parametrize(
    ("task", "kind", "count"),
    [(Pendulum(), TorqueGrid, 7), (CartPole(), Actions, 2)],
)
def test_actions_are_those_of_the_task(task: Task, kind: type, count: int) -> None:
    actions = task.actions(7)
    assert type(actions) is kind
    assert actions.count == task.action_count(7) == count
    np.testing.assert_array_equal(
        [actions.to_env_action(index) for index in range(count)], actions.values
    )


def test_given_torques_are_those_of_the_outputs() -> None:
    assert torque_actions([2, 0, -1], 3).values.tolist() == [[2.0], [0.0], [-1.0]]
    assert torque_actions(None, 3).torques.tolist() == [-2.0, 0.0, 2.0]
    with pytest.raises(ConfigError, match="torques has 3 numbers; the agent has 4 actions"):
        torque_actions([2, 0, -1], 4)
