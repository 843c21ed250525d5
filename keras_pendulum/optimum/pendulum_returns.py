"""The returns of the best policies of the pendulum from the start of each reset seed.

The package contains the returns of seeds 0 to 9999 for g = 1 and for g = 10, for whole episodes and
for the training episodes of `reference` and `swingup`. It contains those of the policies that are
optimal for the discounts of these presets, for seeds 0 to 999.
`python -m benchmarks.learning.shipped_optima` writes them. All others are computed at their first
use, by `best_return`, and stored in the user's cache folder.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.config.fields import Integer
from keras_pendulum.environments.pendulum import STEPS_PER_EPISODE, Pendulum
from keras_pendulum.optimum.solution import USUAL_SEEDS
from keras_pendulum.optimum.stored_results import (
    Problem,
    cache_file,
    read_returns,
    shipped_file,
    write_to_cache,
)


def discounted_return(
    gravity: float,
    discount: float,
    seeds: Iterable[int] = range(100),
    steps: int = STEPS_PER_EPISODE,
) -> NDArray[np.float64]:
    """Returns the undiscounted returns of the policy that is optimal for a discount γ, 0 to 1.

    Those of γ = 1 are the highest possible ones. Stored returns are read in milliseconds. Others
    take about 20 s. They are then stored in the user's cache folder, if it can be written, together
    with those of seeds 0 to 999.

    Args:
        gravity: g in m/s², 0 to 100.
        discount: γ.
        seeds: reset seeds, each 0 to 2³² - 1.
        steps: steps per episode, 1 to 200.

    Returns [number of seeds], in the order of `seeds`; each is attainable. Raises ConfigError for a
    number out of range.
    """
    problem, valid_seed = Problem.valid(gravity, steps, discount), Integer(0, 2**32 - 1)
    seeds = [valid_seed.validate("seed", seed) for seed in seeds]
    cache = cache_file(problem.file_name)
    returns = read_returns(shipped_file(problem.file_name), problem)
    if not returns.keys() >= set(seeds):
        returns = read_returns(cache, problem) | returns
    if not returns.keys() >= set(seeds):
        from keras_pendulum.optimum.best_return import compute_returns  # rarely needed

        missing = sorted({*seeds, *USUAL_SEEDS} - returns.keys())
        computed = compute_returns(problem, Pendulum().starts(missing))
        returns |= zip(missing, computed.tolist(), strict=True)
        arrays = {"seeds": np.array(list(returns)), "returns": np.array(list(returns.values()))}
        write_to_cache(cache, problem._asdict() | arrays)
    return np.array([returns[seed] for seed in seeds], np.float64)
