"""The best possible return of the pendulum, for every reset seed.

Each is a return that was attained, in exact steps from the seed's start, by a policy that trusts
the tables of `keras_pendulum.value_tables`. V at the start is not it: V is smooth at g = 1, but at
g = 10 it has cliffs (a start that can just be caught is worth 30 more than its neighbour) and a
grid smears them, so that there V is off by up to 50 either way, whereas a return that was attained
is possible for certain. Greedy on such a V, the policy misses catches too; so from the starts where
V and the return disagree (at g = 10 one in 22, at g = 1 none), the first steps try every torque.

How close this comes to the best known for the seeds 0 to 999: to 0.01 at g = 1; at g = 10 to 0.1
for all but five of them, to 0.3 for those, and to 0.003 in the mean. Without the search, seeds 28
and 657 would be 17 and 23 short at g = 10, and the mean of the seeds 0 to 99 -132.54, not -132.37.
In the 60 steps of the preset `swingup`, at g = 10: to 0.1 for all but 11, to 0.9 for those, and to
0.005 in the mean, -135.16, against all steps greedy on fine tables of their own, searched too.
Of the seeds beyond, 38 are below their own return of 200 steps, the worst, 8105, by 4.1.

The returns for the seeds 0 to 9999 come with the package for g = 1 and g = 10, and for g = 10 also
those of 60 steps, written by

    python -m keras_pendulum.optimum 1 10 --out keras_pendulum/optimal_values
    python -m keras_pendulum.optimum 10 --steps 60 --out keras_pendulum/optimal_values

and all others are computed when first asked for and kept in the user's cache folder.
"""

from __future__ import annotations

import contextlib
import itertools
import logging
import math
import operator
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.command_line import OneLineParser, run_command
from keras_pendulum.environment import STEPS_PER_EPISODE, pendulum_starts
from keras_pendulum.errors import ConfigError, UserError
from keras_pendulum.known_returns import cache_file, file_name, read, shipped_file, write
from keras_pendulum.value_tables import (
    FINE_CELLS,
    greedy_return,
    solve,
    try_torques,
    value_at,
    value_tables,
)

_log = logging.getLogger(__name__)

COARSE_CELLS = 100  # small enough to keep the tables of all 200 steps, 1.3 MB each
CLIFF = 0.05  # where V is smooth, it and the attained return differ by less
SEARCHED_STEPS = 3  # a fourth gains next to nothing
GREATEST_SEED = 2**32 - 1
SHIPPED_SEEDS = range(10_000)
USUAL_SEEDS = range(1000)


def optimal_return(
    gravity: float = 1.0,
    seeds: Iterable[int] = range(100),
    steps: int = STEPS_PER_EPISODE,
) -> NDArray[np.float64]:
    """The best possible undiscounted return of `steps` steps from each start `reset(seed=…)`.

    Known returns are read in milliseconds. Others take some 20 s of solving, and are then kept in
    the user's cache folder (where that can be written) together with those of seeds 0 to 999.

    Args:
        gravity: g in m/s², 0 to 100.
        seeds: of the starts, each 0 to 2³² - 1.
        steps: of the episode, 1 to 200.

    Returns:
        [number of seeds], in the order of `seeds`; each is a return that was attained.

    Raises:
        ConfigError: (a ValueError) for a gravity, a seed or steps outside their range.
    """
    gravity = _checked_gravity(gravity)
    wanted = [_checked_seed(seed) for seed in seeds]
    steps = _checked_steps(steps)
    known = read(shipped_file(gravity, steps), gravity, steps)
    if not known.keys() >= set(wanted):
        cache = cache_file(gravity, steps)
        cached = read(cache, gravity, steps) if cache else {}
        known |= cached
        missing = sorted(set(wanted) - known.keys())
        if missing:
            missing = sorted({*missing, *USUAL_SEEDS} - known.keys())
            _log.warning("Solving for the best possible returns at g = %g, once: ~20 s", gravity)
            found = _best_return(gravity, pendulum_starts(missing), steps)
            fresh = dict(zip(missing, found.tolist(), strict=True))
            known |= fresh
            with contextlib.suppress(OSError, UserError):  # the cache only saves time
                if cache:
                    cache.parent.mkdir(parents=True, exist_ok=True)
                    write(cache, gravity, steps, cached | fresh)
    return np.array([known[seed] for seed in wanted], np.float64)


def _best_return(gravity: float, starts: NDArray[np.float64], steps: int) -> NDArray[np.float64]:
    """The best of three policies' returns [N] from `starts` [N, 2].

    Where the pendulum can be stood up in time, the fine table of the start serves all steps, and
    on its cliffs a search comes first. From g = 17 or so it cannot: V depends on the steps to go
    to the end, and at g = 20 that policy would lose 5 %; there coarse tables, one for each step,
    lose 0.3 % at most against finer ones. In a short episode V depends on them, too; its fewer
    tables may be finer in the same memory.
    """
    table = solve(gravity, steps)
    cells = min(FINE_CELLS, COARSE_CELLS * STEPS_PER_EPISODE // steps)
    every_step = list(itertools.islice(value_tables(gravity, cells), steps))
    fine = greedy_return([table] * steps, gravity, starts)
    coarse = greedy_return(every_step, gravity, starts)
    best = np.maximum(fine, coarse)
    on_cliff = np.abs(value_at(table, *starts.T) - best) > CLIFF
    for i in np.flatnonzero(on_cliff & (fine >= coarse)):
        best[i] = max(best[i], _searched_return(table, gravity, starts[i], steps))
    return best


def _searched_return(
    table: NDArray[np.float32], gravity: float, start: NDArray[np.float64], steps: int
) -> float:
    """The best return found from `start` (θ, θ̇) by trying every torque in the first steps.

    What a torque is worth is not read from V, but attained: its exact step, then the greedy ones.
    The greedy torque is among those tried, so that no step makes the return worse.
    """
    state, past = start, 0.0
    for step in range(1, min(SEARCHED_STEPS, steps) + 1):
        rewards, thetas, speeds = try_torques(gravity, state[:1], state[1:])  # [1, A]
        states = np.stack([thetas[0], speeds[0]], axis=1)  # [A, 2]
        future = greedy_return([table] * (steps - step), gravity, states)
        returns = past + rewards[0] + future  # [A]
        chosen = returns.argmax()
        past += float(rewards[0, chosen])
        state = states[chosen]
    return float(returns[chosen])


def _checked_gravity(gravity: float) -> float:
    try:
        number = float(gravity)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not 0 <= number <= 100:  # written so that NaN fails too
        raise ConfigError(f"gravity is {gravity!r}; expected a number from 0 to 100 (m/s²)")
    return number + 0.0  # -0.0 becomes 0.0


def _checked_seed(seed: int) -> int:
    number = operator.index(seed)
    if not 0 <= number <= GREATEST_SEED:
        raise ConfigError(f"seed is {seed}; expected 0 to {GREATEST_SEED}")
    return number


def _checked_steps(steps: int) -> int:
    number = operator.index(steps)
    if not 1 <= number <= STEPS_PER_EPISODE:
        raise ConfigError(f"steps is {steps}; expected 1 to {STEPS_PER_EPISODE}")
    return number


def main(arguments: Sequence[str] | None = None) -> int:
    """Computes the returns for some gravities and writes the files that ship with the package."""
    parser = OneLineParser(prog="python -m keras_pendulum.optimum", description=main.__doc__)
    parser.add_argument("gravity", nargs="+", type=float, help="in m/s², 0 to 100")
    parser.add_argument(
        "--steps", type=int, default=STEPS_PER_EPISODE, help="of an episode, 1 to %(default)s"
    )
    parser.add_argument("--out", type=Path, required=True, help="folder for gravity_<g>.npz")
    options = parser.parse_args(arguments)
    steps = _checked_steps(options.steps)
    starts = pendulum_starts(SHIPPED_SEEDS)
    for gravity in map(_checked_gravity, options.gravity):
        returns = _best_return(gravity, starts, steps).tolist()
        path = options.out / file_name(gravity, steps)
        write(path, gravity, steps, dict(zip(SHIPPED_SEEDS, returns, strict=True)))
        print(f"{path}: mean {np.mean(returns):.4f}")
    return 0


if __name__ == "__main__":
    sys.exit(run_command(main))
