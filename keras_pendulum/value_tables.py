"""V, the best sum of rewards that the pendulum can still collect, by dynamic programming.

Backward in time (Bellman 1957, chapter III), with the 41 torques as actions: V is 0 after the last
step, and one step earlier

    V(θ, θ̇) = -(θ² + 0.1 θ̇²) + max over u of [-0.001 u² + γ V(θ + dt·w, w)],
    w = clip(θ̇ + dt·(1.5 g sin θ + 3 u), -8, 8),

which are the reward and the dynamics of Gymnasium's `Pendulum-v1`. V stands on a grid with
linear interpolation; `greedy_return` tells what a policy that trusts it attains without the grid.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.environment import STEPS_PER_EPISODE
from keras_pendulum.torque import TorqueGrid

TIME_STEP = 0.05  # s
MAX_SPEED = 8.0  # rad/s
TORQUES = TorqueGrid().torques  # [41] N·m
CELLS_PER_TORQUE = 3  # with 3, both one torque's effect and the 8 rad/s are whole cells
SPEED_STEP = TIME_STEP * 3 * (TORQUES[1] - TORQUES[0]) / CELLS_PER_TORQUE  # 0.005 rad/s
FINE_CELLS = 1600  # in [-π, 0]: resolves the cliffs that V has at g = 10
STRIP = 32  # columns backed up at a time: what stays in the processor's own memory

_Tried = NDArray[np.float64]  # [N, 41]: of every torque, from N states


def solve(
    gravity: float,
    horizon: int = STEPS_PER_EPISODE,
    theta_cells: int = FINE_CELLS,
    discount: float = 1.0,
) -> NDArray[np.float32]:
    """V with `horizon` steps to go: one table of `value_tables`."""
    return next(itertools.islice(value_tables(gravity, theta_cells, discount), horizon, None))


def value_tables(
    gravity: float, theta_cells: int, discount: float = 1.0
) -> Iterator[NDArray[np.float32]]:
    """V with 0, 1, 2, … steps to go, without end: the best sum of the rewards to come.

    Three properties make it fast. (1) All successors of a state lie on the line (θ + dt·w, w), so
    interpolating in θ is a shift of each row, and interpolating in w is one of each column.
    (2) A torque moves w by a whole number of cells, so the maximum is one over shifted copies.
    (3) V(-θ, -θ̇) = V(θ, θ̇), so half of the angles suffice.

    Args:
        gravity: g in m/s².
        theta_cells: cells in [-π, 0], 10 or more.
        discount: γ; 1 for the return of an episode.

    Yields:
        [3201, theta_cells + 1]: rows are θ̇ from -8 to 8 rad/s, columns θ from -π to 0 rad.
    """
    half = round(MAX_SPEED / SPEED_STEP)
    speed = np.arange(-half, half + 1) * SPEED_STEP  # [S]
    theta = np.linspace(-np.pi, 0, theta_cells + 1)  # [T]
    rows, columns = len(speed), len(theta)
    reward = (-(theta**2) - 0.1 * speed[:, None] ** 2).astype(np.float32)  # [S, T]
    cost = (0.001 * TORQUES[len(TORQUES) // 2 :] ** 2).astype(np.float32)  # [21], of ±u

    theta_shift, theta_weight = _cells(TIME_STEP * speed * theta_cells / np.pi)  # [S]
    margin = int(theta_shift.max()) + 2
    breaks = np.flatnonzero(np.diff(theta_shift)) + 1
    groups = list(zip([0, *breaks], [*breaks, rows], strict=True))  # rows that shift alike

    speed_shift, speed_weight = _cells(TIME_STEP * 1.5 * gravity * np.sin(theta) / SPEED_STEP)
    reach = CELLS_PER_TORQUE * (len(TORQUES) // 2)
    pad = reach + int(np.abs(speed_shift).max()) + 2
    on_line = np.empty((rows + 2 * pad, columns), np.float32)  # V at (θ + dt·w, w)
    strips = [slice(first, first + STRIP) for first in range(0, columns, STRIP)]

    value = np.zeros_like(reward)

    def shift_in_theta(group: tuple[int, int]) -> None:
        first, last = group
        start = margin + int(theta_shift[first])
        left = mirrored[first:last, start : start + columns]
        right = mirrored[first:last, start + 1 : start + 1 + columns]
        out = on_line[pad + first : pad + last]
        np.subtract(right, left, out=out)
        out *= theta_weight[first:last, None]
        out += left

    def back_up(strip: slice) -> None:
        line = np.arange(pad - reach, pad + rows + reach + 1)[:, None] + speed_shift[strip]
        line *= columns
        line += np.arange(columns)[strip]
        near = on_line.take(line)
        after = near[1:] - near[:-1]
        after *= speed_weight[strip]
        after += near[:-1]  # [S + 2 reach, strip], V after gravity's pull
        best = after[reach : reach + rows].copy()
        either = np.empty_like(best)
        for torque in range(1, len(cost)):
            shift = torque * CELLS_PER_TORQUE
            up = after[reach + shift : reach + shift + rows]
            down = after[reach - shift : reach - shift + rows]
            np.maximum(up, down, out=either)
            either -= cost[torque]
            np.maximum(best, either, out=best)
        np.add(best, reward[:, strip], out=value[:, strip])

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        while True:
            yield value
            mirrored = _mirrored(np.float32(discount) * value, margin)
            list(pool.map(shift_in_theta, groups))
            on_line[:pad] = on_line[pad]  # beyond ±8 rad/s the speed is clipped
            on_line[-pad:] = on_line[-pad - 1]
            value = np.empty_like(reward)
            list(pool.map(back_up, strips))


def value_at(
    table: NDArray[np.float32], theta: NDArray[np.float64], speed: NDArray[np.float64]
) -> NDArray[np.float64]:
    """V of `solve`'s table at any angle (rad) and speed (±8 rad/s), of one shape, linearly."""
    theta = (theta + np.pi) % (2 * np.pi) - np.pi
    speed = np.where(theta > 0, -speed, speed)
    row_position = (speed + MAX_SPEED) / SPEED_STEP
    column_position = (np.pi - np.abs(theta)) * (table.shape[1] - 1) / np.pi
    row = np.minimum(row_position.astype(np.intp), table.shape[0] - 2)
    column = np.minimum(column_position.astype(np.intp), table.shape[1] - 2)
    up, right = row_position - row, column_position - column  # fractions of a cell
    corner = row * table.shape[1] + column
    low = table.take(corner) * (1 - right) + table.take(corner + 1) * right
    corner += table.shape[1]
    high = table.take(corner) * (1 - right) + table.take(corner + 1) * right
    return np.asarray(low * (1 - up) + high * up)


def greedy_return(
    tables: Sequence[NDArray[np.float32]], gravity: float, starts: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Returns [N] of exact steps from `starts` [N, 2] (θ, θ̇), each greedy on V after it.

    Takes as many steps as there are `tables`; `tables[k]` serves the step with k to go after it.
    """

    def choose(step: int, rewards: _Tried, thetas: _Tried, speeds: _Tried) -> NDArray[np.intp]:
        return (rewards + value_at(tables[-1 - step], thetas, speeds)).argmax(axis=1)

    return exact_return(choose, len(tables), gravity, starts)


def exact_return(
    choose: Callable[[int, _Tried, _Tried, _Tried], NDArray[Any]],
    steps: int,
    gravity: float,
    starts: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Returns [N] of exact steps from `starts` [N, 2] (θ, θ̇).

    Args:
        choose: gives the torques' indices [N] from a step's number, the first being 0, and what
            `try_torques` tells of every torque in it.
        steps: of an episode.
        gravity: g in m/s².
        starts: θ in rad and θ̇ in rad/s.
    """
    theta, speed = starts.T  # [N]
    total = np.zeros(len(starts))
    everyone = np.arange(len(starts))
    for step in range(steps):
        rewards, thetas, speeds = try_torques(gravity, theta, speed)
        chosen = choose(step, rewards, thetas, speeds)
        total += rewards[everyone, chosen]
        theta, speed = thetas[everyone, chosen], speeds[everyone, chosen]
    return total


def try_torques(
    gravity: float, theta: NDArray[np.float64], speed: NDArray[np.float64]
) -> tuple[_Tried, _Tried, _Tried]:
    """One exact step with every torque: rewards, next θ and next θ̇ [N, 41] from θ and θ̇ [N]."""
    # In Gymnasium's own order of operations: the last digits are then the same.
    pull = 3 * gravity / 2 * np.sin(theta)
    next_speed = speed[:, None] + (pull[:, None] + 3 * TORQUES) * TIME_STEP  # [N, A]
    next_speed = np.clip(next_speed, -MAX_SPEED, MAX_SPEED)
    angle = (theta + np.pi) % (2 * np.pi) - np.pi
    cost = (angle**2 + 0.1 * speed**2)[:, None] + 0.001 * TORQUES**2
    return -cost, theta[:, None] + next_speed * TIME_STEP, next_speed


def _cells(position: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.float32]]:
    """A position in cells as whole cells and the fraction of one that is left."""
    whole = np.floor(position)
    return whole.astype(np.intp), (position - whole).astype(np.float32)


def _mirrored(value: NDArray[np.float32], margin: int) -> NDArray[np.float32]:
    """The table [S, T] with `margin` columns more on both sides, by V(-θ, -θ̇) = V(θ, θ̇)."""
    before = value[::-1, margin:0:-1]
    after = value[::-1, -2 : -2 - margin : -1]
    return np.concatenate([before, value, after], axis=1)
