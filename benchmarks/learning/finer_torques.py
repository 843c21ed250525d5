"""What torques between the 41 of the optimum can gain.

    python -m benchmarks.learning.finer_torques [STARTS]

An agent with continuous torque may collect more than the best policy with 41 torques. This compares
the greedy policies of two exact solutions on the same grid, one for 41 torques and one for 121, and
the second one's greedy choice among 1201 torques, from the starts of seeds 0 to 99. Starts from
which one policy catches the pendulum a swing earlier (a difference above 0.1) are counted apart:
they show the grid, not the torques. It takes some seconds.
"""

from __future__ import annotations

import sys
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from benchmarks.result_files import Row, write
from keras_pendulum.environments.pendulum import STEPS_PER_EPISODE, Pendulum
from keras_pendulum.optimum.dynamics import step_all_torques
from keras_pendulum.optimum.value_iteration import value_at, value_tables

CELLS = 400
TORQUES = {41: 3, 121: 1, 1201: 1}  # and the cells per torque of their table


def main(starts: int = 100) -> None:
    """Computes the returns and writes the table."""
    rows: list[Row] = []
    for gravity in (1.0, 10.0):
        states = Pendulum().starts(range(starts))
        tables = {
            cells: next(
                islice(
                    value_tables(gravity, CELLS, cells_per_torque=cells), STEPS_PER_EPISODE, None
                )
            )
            for cells in set(TORQUES.values())
        }
        returns = {
            count: greedy_return(tables[cells], gravity, np.linspace(-2, 2, count), states)
            for count, cells in TORQUES.items()
        }
        for count in (121, 1201):
            gain = returns[count] - returns[41]
            same = np.abs(gain) <= 0.1
            rows.append(
                {
                    "gravity": gravity,
                    "torques": count,
                    "mean gain": round(float(gain[same].mean()), 4),
                    "largest gain": round(float(gain[same].max()), 4),
                    "smallest gain": round(float(gain[same].min()), 4),
                    "starts": int(same.sum()),
                    "starts with another swing": int((~same).sum()),
                }
            )
    write("finer_torques", "python -m benchmarks.learning.finer_torques", rows)


def greedy_return(
    table: NDArray[np.float32],
    gravity: float,
    torques: NDArray[np.float64],
    starts: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Returns the simulated returns [N] of the greedy choice among `torques` [A] N·m."""
    theta, speed = starts.T
    returns, rows = np.zeros(len(starts)), np.arange(len(starts))
    for _ in range(STEPS_PER_EPISODE):
        rewards, next_theta, next_speed = step_all_torques(gravity, theta, speed, torques)
        best = (rewards + value_at(table, next_theta, next_speed)).argmax(axis=1)
        returns += rewards[rows, best]
        theta, speed = next_theta[rows, best], next_speed[rows, best]
    return returns


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
