"""The optimum for a discount γ: its values, its Q-values, and what its policy collects.

A DQN with γ < 1 learns the policy with the highest discounted sum of rewards. That policy need not
attain the highest return of an episode, so a part of a regret comes from γ and not from learning.

V is computed by `value_iteration` until a sweep changes no value by more than `TOLERANCE`. Then it
is within `TOLERANCE` · γ / (1 - γ) of its limit: 0.007 for γ = 0.985. A discount of 1 has no limit;
its V is that of an episode's 200 steps. The number of sweeps is at most 1000, which matters where
γ is close to 1 and the pendulum cannot be swung up (g = 17 and more).

The returns are simulated, so they are attainable. Their accuracy depends on the cells: with twice
as many, the mean over the seeds 0 to 999 moves by 0.0001 (g = 1, γ = 0.9) and 0.01 (g = 10,
γ = 0.985).
The package contains those of `reference` and `swingup`, also for their training episodes. These
commands write them:

    python -m keras_pendulum.optimum 1 --discount 0.9 --out keras_pendulum/optimum/data
    python -m keras_pendulum.optimum 1 --discount 0.9 --steps 100 --out keras_pendulum/optimum/data
    python -m keras_pendulum.optimum 10 --discount 0.985 --out keras_pendulum/optimum/data
    python -m keras_pendulum.optimum 10 --discount 0.985 --steps 40 \\
        --out keras_pendulum/optimum/data
"""

from __future__ import annotations

import contextlib
import io
import logging
import math
from collections.abc import Iterable
from functools import cache
from itertools import islice, pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.environments.tasks import STEPS_PER_EPISODE, pendulum_starts
from keras_pendulum.errors import ConfigError, UserError
from keras_pendulum.optimum.dynamics import (
    MAX_SPEED,
    TORQUES,
    ByTorque,
    simulate_return,
    step_all_torques,
)
from keras_pendulum.optimum.optimal_return import (
    USUAL_SEEDS,
    optimal_return,
    validate_gravity,
    validate_seed,
    validate_steps,
)
from keras_pendulum.optimum.return_cache import (
    LOWEST_REWARD,
    cache_folder,
    file_name,
    stored_returns,
)
from keras_pendulum.optimum.value_iteration import SPEED_STEP, solve, value_at, value_tables
from keras_pendulum.storage.atomic_write import write_atomically

_log = logging.getLogger(__name__)

CELLS = 400  # in [-π, 0], of the tables in the cache, 5 MB each
RETURN_CELLS = 800  # of the table for simulated returns, which is not stored
TOLERANCE = 1e-4
LARGEST_SWEEPS = 1000
_SPEEDS = 2 * round(MAX_SPEED / SPEED_STEP) + 1  # rows of a table


def discounted_value(gravity: float, discount: float, cells: int = CELLS) -> NDArray[np.float32]:
    """Returns V of the optimum for a discount, as a table for `value_at` and `exact_q`.

    It takes about 5 s. A table of the usual number of cells is stored in the user's cache folder,
    if it can be written.

    Args:
        gravity: g in m/s², 0 to 100.
        discount: γ, 0 to 1.
        cells: number of cells in [-π, 0], at least 10.

    Returns:
        [3201, cells + 1]: rows are θ̇ from -8 to 8 rad/s, columns are θ from -π to 0 rad.

    Raises:
        ConfigError: (a ValueError) for a gravity or a discount out of range.
    """
    gravity, discount = validate_gravity(gravity), validate_discount(discount)
    folder = cache_folder() if cells == CELLS else None
    file = folder / f"value_{file_name(gravity, STEPS_PER_EPISODE, discount)}" if folder else None
    table = _read(file, gravity, discount) if file else None
    if table is None:
        _log.warning(
            "Computing the exact values for g = %g and γ = %g, once: about 5 s", gravity, discount
        )
        table = _solve(gravity, discount, cells)
        with contextlib.suppress(OSError, UserError):  # the cache only saves time
            if file:
                file.parent.mkdir(parents=True, exist_ok=True)
                buffer = io.BytesIO()
                np.savez_compressed(buffer, gravity=gravity, discount=discount, value=table)
                write_atomically(file, buffer.getvalue())
    return table


def exact_q(
    table: NDArray[np.float32],
    gravity: float,
    discount: float,
    theta: NDArray[np.float64],
    speed: NDArray[np.float64],
    torques: NDArray[np.float64] = TORQUES,
) -> ByTorque:
    """Returns the Q-values [N, A] of the optimum: reward + γ V(next state).

    Args:
        table: V, from `discounted_value` for the same gravity and discount.
        gravity: g in m/s².
        discount: γ.
        theta: [N] rad, any angle.
        speed: [N] rad/s, -8 to 8.
        torques: [A] N·m of the first step. All later ones are those of V: the best of 41.
    """
    rewards, next_theta, next_speed = step_all_torques(gravity, theta, speed, torques)
    return rewards + discount * value_at(table, next_theta, next_speed)


def discounted_return(
    gravity: float,
    discount: float,
    seeds: Iterable[int] = range(100),
    steps: int = STEPS_PER_EPISODE,
) -> NDArray[np.float64]:
    """Returns the undiscounted returns of the policy that is optimal for a discount.

    Stored returns are read in milliseconds. Others take about 10 s. They are then stored in the
    user's cache folder. A discount of 1 gives the optimal returns.

    Args:
        gravity: g in m/s², 0 to 100.
        discount: γ, 0 to 1.
        seeds: reset seeds of the starts, each 0 to 2³² - 1.
        steps: steps per episode, 1 to 200.

    Returns:
        [number of seeds]

    Raises:
        ConfigError: (a ValueError) for a gravity, a discount, a seed or steps out of range.
    """
    gravity, discount = validate_gravity(gravity), validate_discount(discount)
    seeds, steps = [validate_seed(seed) for seed in seeds], validate_steps(steps)
    if discount == 1:
        return optimal_return(gravity, seeds, steps)

    def compute(missing: list[int]) -> NDArray[np.float64]:
        _log.warning(
            "Computing what the policy for γ = %g collects at g = %g, once: about 10 s",
            discount,
            gravity,
        )
        return simulate_discounted(gravity, discount, pendulum_starts(missing), steps)

    return stored_returns(seeds, compute, USUAL_SEEDS, gravity, steps, discount)


@cache
def discount_cost(gravity: float, discount: float, seeds: range) -> float:
    """Returns the regret of the policy that is optimal for a discount: what γ alone costs.

    It is the mean difference between `optimal_return` and `discounted_return`, at least 0.
    """
    loss = optimal_return(gravity, seeds) - discounted_return(gravity, discount, seeds)
    return max(0.0, float(loss.mean()))


def simulate_discounted(
    gravity: float, discount: float, starts: NDArray[np.float64], steps: int
) -> NDArray[np.float64]:
    """Returns the undiscounted returns [N] of the policy that is greedy on V of a discount.

    Args:
        gravity: g in m/s².
        discount: γ.
        starts: [N, 2], θ in rad and θ̇ in rad/s.
        steps: steps per episode.
    """
    table = _solve(gravity, discount, RETURN_CELLS)

    def choose_greedy(
        step: int, rewards: ByTorque, next_theta: ByTorque, next_speed: ByTorque
    ) -> NDArray[np.intp]:
        return (rewards + discount * value_at(table, next_theta, next_speed)).argmax(axis=1)

    return simulate_return(choose_greedy, steps, gravity, starts)


def validate_discount(discount: float) -> float:
    """Returns the discount as a float. Raises ConfigError unless it is 0 to 1."""
    try:
        number = float(discount)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not 0 <= number <= 1:  # written so that NaN fails too
        raise ConfigError(f"discount is {discount!r}; expected a number from 0 to 1")
    return number + 0.0  # -0.0 becomes 0.0


def _solve(gravity: float, discount: float, cells: int) -> NDArray[np.float32]:
    if discount == 1:
        return solve(gravity, STEPS_PER_EPISODE, cells)
    tables = islice(value_tables(gravity, cells, discount), LARGEST_SWEEPS + 1)
    for before, table in pairwise(tables):
        if np.abs(table - before).max() <= TOLERANCE:
            break
    return table


def _read(path: Path, gravity: float, discount: float) -> NDArray[np.float32] | None:
    """Returns the table of a file of the cache.

    Returns None when the file is missing, damaged, or of another gravity or discount.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            found = (float(file["gravity"]), float(file["discount"]))
            table: NDArray[np.float32] = file["value"]
    except Exception:  # one flipped bit of an archive can raise any of seven exception types
        return None
    lowest = LARGEST_SWEEPS * LOWEST_REWARD
    valid = (
        found == (gravity, discount)
        and table.dtype == np.float32
        and table.shape == (_SPEEDS, CELLS + 1)
        and bool(((table >= lowest) & (table <= 0)).all())
    )
    return table if valid else None
