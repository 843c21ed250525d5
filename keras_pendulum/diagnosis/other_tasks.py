"""The exact values of other gravities and discounts, to compare learned values with.

The package contains coarse tables of 56 tasks. This command writes them:

    python -m keras_pendulum.diagnosis.other_tasks FILE.npz
"""

from __future__ import annotations

import io
import sys
from functools import cache
from importlib import resources
from itertools import islice, pairwise

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.optimum.value_iteration import value_tables

GRAVITIES = (0.0, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0)  # m/s²
DISCOUNTS = (0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99)
_CELLS = 80  # in [-π, 0], of the computation
_EVERY_ROW, _EVERY_COLUMN = 64, 2  # of the computed table that is stored
_ROWS = 3201  # of a table of `value_iteration`


def other_value(gravity: float, discount: float) -> NDArray[np.float32]:
    """Returns V as a coarse table for `value_at` and `exact_q`.

    It has 3201 rows, interpolated linearly between the stored ones.

    Args:
        gravity: one of GRAVITIES.
        discount: one of DISCOUNTS.
    """
    tables = _stored_tables()
    table = tables[GRAVITIES.index(gravity), DISCOUNTS.index(discount)].astype(np.float32)
    position = np.linspace(0, len(table) - 1, _ROWS)
    low = np.minimum(position.astype(int), len(table) - 2)
    weight = (position - low)[:, None].astype(np.float32)
    return table[low] * (1 - weight) + table[low + 1] * weight


@cache
def _stored_tables() -> NDArray[np.float16]:
    """Returns the tables [G, D, 51, 41]."""
    data = resources.files("keras_pendulum.diagnosis") / "data" / "other_tasks.npz"
    with np.load(io.BytesIO(data.read_bytes()), allow_pickle=False) as file:
        tables: NDArray[np.float16] = file["values"]
    return tables


def _compute(gravity: float, discount: float) -> NDArray[np.float16]:
    for before, table in pairwise(islice(value_tables(gravity, _CELLS, discount), 600)):
        if np.abs(table - before).max() < 1e-3:
            break
    return table[::_EVERY_ROW, ::_EVERY_COLUMN].astype(np.float16)


def main(path: str) -> None:
    """Computes the tables and writes the file."""
    values = [[_compute(gravity, discount) for discount in DISCOUNTS] for gravity in GRAVITIES]
    np.savez_compressed(path, values=np.array(values))


if __name__ == "__main__":
    main(sys.argv[1])
