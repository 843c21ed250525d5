"""The optima in the package: the files in `keras_pendulum/optimum/data`.

    python -m benchmarks.learning.shipped_optima [FOLDER]

Computes the best possible returns of the pendulum for the seeds 0 to 9999, and those of the optimal
policy for the discount of `reference` and `swingup` for the seeds 0 to 999. Computes the optimal
values of the pendulum's episodes, and those of CartPole for the usual discounts. It takes some ten
minutes.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.optimum import episode_values
from keras_pendulum.optimum.best_return import compute_returns
from keras_pendulum.optimum.cartpole_values import file_name, pack, solve_cartpole
from keras_pendulum.optimum.stored_results import Problem, write_arrays

DATA = Path(__file__).parents[2] / "keras_pendulum" / "optimum" / "data"
# Gravity and discount of `reference` and `swingup`, with the steps of a whole and of a training
# episode.
SHIPPED = [
    Problem(gravity, steps, discount)
    for gravity, training_steps, own_discount in ((1.0, 100, 0.9), (10.0, 40, 0.985))
    for steps in (200, training_steps)
    for discount in (1.0, own_discount)
]
GRAVITIES = (1.0, 10.0)
CARTPOLE_DISCOUNTS = (0.9, 0.95, 0.98, 0.99, 0.995, 1.0)


def main(folder: str = str(DATA)) -> None:
    """Computes returns and values, and writes the files into an existing folder."""
    starts = Pendulum().starts(range(10_000))
    for problem in SHIPPED:
        seeds = range(10_000 if problem.discount == 1 else 1000)
        returns = compute_returns(problem, starts[: len(seeds)])
        path = Path(folder) / problem.file_name
        write_arrays(path, {**problem._asdict(), "seeds": np.array(seeds), "returns": returns})
        print(f"{path}: mean {returns.mean():.4f}")
    for gravity in GRAVITIES:
        path = Path(folder) / episode_values.file_name(Problem.valid(gravity))
        values = episode_values.solve_episode(gravity)
        write_arrays(path, episode_values.pack(values))
        print(f"{path}: root of the lowest value {values.roots.max() * values.scale:.4f}")
    for discount in CARTPOLE_DISCOUNTS:
        path, table = Path(folder) / file_name(discount), solve_cartpole(discount)
        write_arrays(path, pack(table))
        print(f"{path}: mean {table.mean():.4f}")


if __name__ == "__main__":
    main(*sys.argv[1:])
