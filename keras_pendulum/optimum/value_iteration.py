"""Value iteration: the optimal value V of the pendulum on a grid, by dynamic programming.

V is computed backward in time (Bellman 1957, chapter III) with the 41 torques as actions. It is 0
after the last step. One step earlier it is

    V(θ, θ̇) = -(θ² + 0.1 θ̇²) + max over u of [-0.001 u² + γ V(θ + dt·w, w)],
    w = clip(θ̇ + dt·(1.5 g sin θ + 3 u), -8, 8),

with the reward and the dynamics of Gymnasium's `Pendulum-v1`. Values between grid points are
interpolated linearly. `greedy_return` simulates the policy that is greedy on V; its states are
exact, only its choices depend on the grid.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.environments.pendulum import MAX_SPEED, STEPS_PER_EPISODE
from keras_pendulum.environments.torque import MAX_TORQUE
from keras_pendulum.optimum.dynamics import (
    TIME_STEP,
    TORQUES,
    ByTorque,
    simulate_return,
)

CELLS_PER_TORQUE = 3  # with 3, both one torque's effect and the 8 rad/s are whole cells
SPEED_STEP = TIME_STEP * 3 * (TORQUES[1] - TORQUES[0]) / CELLS_PER_TORQUE  # 0.005 rad/s
FINE_CELLS = 1600  # in [-π, 0]: resolves the discontinuities that V has at g = 10
STRIP_WIDTH = 32  # columns per backup: their arrays fit into the processor's cache


def solve(
    gravity: float,
    horizon: int = STEPS_PER_EPISODE,
    theta_cells: int = FINE_CELLS,
    discount: float = 1.0,
) -> NDArray[np.float32]:
    """Returns V with `horizon` steps to go: one table of `value_tables`."""
    return next(itertools.islice(value_tables(gravity, theta_cells, discount), horizon, None))


def value_tables(
    gravity: float,
    theta_cells: int,
    discount: float = 1.0,
    cells_per_torque: int = CELLS_PER_TORQUE,
) -> Iterator[NDArray[np.float32]]:
    """Yields V with 0, 1, 2, … steps to go, without end.

    Three properties make it fast. (1) All successors of a state are on the line (θ + dt·w, w), so
    interpolation in θ shifts each row, and interpolation in w shifts each column. (2) A torque
    changes w by a whole number of cells, so the maximum is taken over shifted copies.
    (3) V(-θ, -θ̇) = V(θ, θ̇), so half of the angles suffice.

    Args:
        gravity: g in m/s².
        theta_cells: number of cells in [-π, 0], at least 10.
        discount: γ; 1 for the undiscounted return of an episode.
        cells_per_torque: cells from one torque's effect to the next one's: 3 for the 41 torques, 1
            for 121.

    Yields:
        [3201, theta_cells + 1]: rows are θ̇ from -8 to 8 rad/s, columns are θ from -π to 0 rad.
    """
    half = round(MAX_SPEED / SPEED_STEP)
    speed = np.arange(-half, half + 1) * SPEED_STEP  # [S] rad/s
    theta = np.linspace(-np.pi, 0, theta_cells + 1)  # [T] rad
    rows, columns = len(speed), len(theta)
    reward = (-(theta**2) - 0.1 * speed[:, None] ** 2).astype(np.float32)  # [S, T], torque 0
    reach = CELLS_PER_TORQUE * (len(TORQUES) // 2)  # rows by which 2 N·m change the speed
    torques = np.linspace(0, MAX_TORQUE, reach // cells_per_torque + 1)
    torque_cost = (0.001 * torques**2).astype(np.float32)  # [21], u ≥ 0

    theta_shift, theta_weight = _whole_and_fraction(TIME_STEP * speed * theta_cells / np.pi)  # [S]
    margin = int(theta_shift.max()) + 2
    breaks = np.flatnonzero(np.diff(theta_shift)) + 1
    row_groups = list(zip([0, *breaks], [*breaks, rows], strict=True))  # rows of equal shift

    speed_shift, speed_weight = _whole_and_fraction(
        TIME_STEP * 1.5 * gravity * np.sin(theta) / SPEED_STEP
    )  # [T]
    pad = reach + int(np.abs(speed_shift).max()) + 2
    successor_line = np.empty((rows + 2 * pad, columns), np.float32)  # γ V(θ + dt·w, w)
    strips = [slice(first, first + STRIP_WIDTH) for first in range(0, columns, STRIP_WIDTH)]

    value = np.zeros_like(reward)

    def shift_in_theta(group: tuple[int, int]) -> None:
        first, last = group
        start = margin + int(theta_shift[first])
        left = mirrored[first:last, start : start + columns]
        right = mirrored[first:last, start + 1 : start + 1 + columns]
        out = successor_line[pad + first : pad + last]
        np.subtract(right, left, out=out)
        out *= theta_weight[first:last, None]
        out += left

    def back_up(strip: slice) -> None:
        position = np.arange(pad - reach, pad + rows + reach + 1)[:, None] + speed_shift[strip]
        position *= columns
        position += np.arange(columns)[strip]
        lower_and_upper = successor_line.take(position)  # [S + 2 reach + 1, strip]
        successor = lower_and_upper[1:] - lower_and_upper[:-1]
        successor *= speed_weight[strip]
        successor += lower_and_upper[:-1]  # [S + 2 reach, strip], gravity included
        best = successor[reach : reach + rows].copy()  # torque 0
        best_sign = np.empty_like(best)  # the better one of u and -u
        for k in range(1, len(torque_cost)):
            shift = k * cells_per_torque
            positive = successor[reach + shift : reach + shift + rows]
            negative = successor[reach - shift : reach - shift + rows]
            np.maximum(positive, negative, out=best_sign)
            best_sign -= torque_cost[k]
            np.maximum(best, best_sign, out=best)
        np.add(best, reward[:, strip], out=value[:, strip])

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        while True:
            yield value
            discounted = np.float32(discount) * value
            # `margin` more columns on both sides, from V(-θ, -θ̇) = V(θ, θ̇).
            before, after = discounted[::-1, margin:0:-1], discounted[::-1, -2 : -2 - margin : -1]
            mirrored = np.concatenate([before, discounted, after], axis=1)
            list(pool.map(shift_in_theta, row_groups))
            successor_line[:pad] = successor_line[pad]  # the speed is clipped to ±8 rad/s
            successor_line[-pad:] = successor_line[-pad - 1]
            value = np.empty_like(reward)
            list(pool.map(back_up, strips))


def value_at(
    table: NDArray[np.float32], theta: NDArray[np.float64], speed: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Returns V at any states, interpolated linearly in a table of `value_tables`.

    Args:
        table: [3201, columns].
        theta: rad, any angle and any shape.
        speed: rad/s, -8 to 8, of the same shape as `theta`.
    """
    theta = (theta + np.pi) % (2 * np.pi) - np.pi
    speed = np.where(theta > 0, -speed, speed)
    row_position = (speed + MAX_SPEED) / SPEED_STEP
    column_position = (np.pi - np.abs(theta)) * (table.shape[1] - 1) / np.pi
    row = np.minimum(row_position.astype(np.intp), table.shape[0] - 2)
    column = np.minimum(column_position.astype(np.intp), table.shape[1] - 2)
    row_weight, column_weight = row_position - row, column_position - column
    corner = row * table.shape[1] + column
    low = table.take(corner) * (1 - column_weight) + table.take(corner + 1) * column_weight
    corner += table.shape[1]
    high = table.take(corner) * (1 - column_weight) + table.take(corner + 1) * column_weight
    return np.asarray(low * (1 - row_weight) + high * row_weight)


def greedy_return(
    tables: Sequence[NDArray[np.float32]],
    gravity: float,
    starts: NDArray[np.float64],
    discount: float = 1.0,
) -> NDArray[np.float64]:
    """Returns the undiscounted returns [N] of the policy that is greedy on V of the next state.

    Args:
        tables: one for each step of the episode; the step before the last k uses `tables[k]`.
        gravity: m/s².
        starts: [N, 2], θ in rad and θ̇ in rad/s.
        discount: γ of V.
    """

    def choose_greedy(
        step: int, rewards: ByTorque, next_theta: ByTorque, next_speed: ByTorque
    ) -> NDArray[np.intp]:
        value = value_at(tables[-1 - step], next_theta, next_speed)
        return (rewards + discount * value).argmax(axis=1)

    return simulate_return(choose_greedy, len(tables), gravity, starts)


def _whole_and_fraction(
    position: NDArray[np.float64],
) -> tuple[NDArray[np.intp], NDArray[np.float32]]:
    """Returns the whole cells of a position and the remaining fraction of a cell."""
    whole = np.floor(position)
    return whole.astype(np.intp), (position - whole).astype(np.float32)
