from __future__ import annotations

import numpy as np
import pytest

from keras_pendulum.torque import TorqueGrid


def test_the_grid_is_the_originals_linspace() -> None:
    grid = TorqueGrid(41)
    np.testing.assert_array_equal(grid.torques, np.linspace(-2, 2, 41))
    assert grid.count == 41


@pytest.mark.parametrize("count", [2, 3, 41, 101])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_every_index_comes_back_from_its_torque(count: int, dtype: type[np.floating]) -> None:
    grid = TorqueGrid(count)
    back = [grid.nearest_index(float(dtype(grid.control(index)[0]))) for index in range(count)]
    assert back == list(range(count))


def test_a_torque_between_two_goes_to_the_nearer() -> None:
    grid = TorqueGrid(41)
    assert grid.nearest_index(-1.96) == 0
    assert grid.nearest_index(-1.94) == 1


@pytest.mark.parametrize("torque", [float("nan"), float("inf"), -2.001, 2.001])
def test_a_torque_off_the_grid_is_refused(torque: float) -> None:
    with pytest.raises(ValueError, match="expected a number from -2 to 2"):
        TorqueGrid(41).nearest_index(torque)


def test_the_environment_gets_float64_of_shape_1() -> None:
    torque = TorqueGrid(41).control(3)
    assert torque.shape == (1,)
    assert torque.dtype == np.float64
    assert torque[0] == pytest.approx(-1.7)
