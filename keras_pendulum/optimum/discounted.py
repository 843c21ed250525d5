"""The optimal values of the pendulum for a discount γ.

A DQN with γ < 1 learns the policy with the highest discounted sum of rewards. That policy need not
attain the highest return of an episode, so a part of a regret comes from γ and not from learning.

V is computed by `value_iteration` until a sweep changes no value by more than `TOLERANCE`. Then it
is within `TOLERANCE` · γ / (1 - γ) of its limit: 0.007 for γ = 0.985. A discount of 1 has no limit;
its V is that of an episode's 200 steps. The number of sweeps is at most 1000, which matters where
γ is close to 1 and the pendulum cannot be swung up (g = 17 and more).
"""

from __future__ import annotations

from itertools import islice, pairwise

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.environments.pendulum import MAX_SPEED, STEPS_PER_EPISODE, Pendulum
from keras_pendulum.optimum.stored_results import (
    Arrays,
    Problem,
    are_between,
    arrays_of,
    stored_or_computed,
)
from keras_pendulum.optimum.value_iteration import SPEED_STEP, solve, value_tables

CELLS = 400  # in [-π, 0], of the tables in the cache, 5 MB each
TOLERANCE = 1e-4
LARGEST_SWEEPS = 1000
_SHAPE = (2 * round(MAX_SPEED / SPEED_STEP) + 1, CELLS + 1)  # of a table
_LOWEST = LARGEST_SWEEPS * Pendulum.reward_range[0]  # value


def discounted_value(gravity: float, discount: float) -> NDArray[np.float32]:
    """Returns V of the optimum at a gravity in m/s² for a discount, as a table of `value_tables`.

    It takes about 5 s. The table is stored in the user's cache folder, if it can be written. Raises
    ConfigError for a number out of range.
    """
    problem = Problem.valid(gravity, discount=discount)
    return stored_or_computed(
        f"value_{problem.file_name}",
        unpack=lambda arrays: _unpack(arrays, problem),
        compute=lambda: solve_discounted(problem.gravity, problem.discount, CELLS),
        pack=lambda table: {**problem._asdict(), "value": table},
        what=f"the exact values for g = {gravity:g} and γ = {discount:g}, once: about 5 s",
    )


def _unpack(arrays: Arrays, problem: Problem) -> NDArray[np.float32] | None:
    """Returns the table of a file's arrays; None where they cannot be right."""
    for table in arrays_of(arrays, problem, "value"):
        if table.dtype == np.float32 and table.shape == _SHAPE and are_between(_LOWEST, table):
            return table
    return None


def solve_discounted(gravity: float, discount: float, cells: int) -> NDArray[np.float32]:
    """Returns V of the optimum for a discount with `cells` cells in [-π, 0], at least 10."""
    if discount == 1:
        return solve(gravity, STEPS_PER_EPISODE, cells)
    tables = islice(value_tables(gravity, cells, discount), LARGEST_SWEEPS + 1)
    for before, table in pairwise(tables):
        if np.abs(table - before).max() <= TOLERANCE:
            break
    return table
