"""The value of each setting in which a preset departs from an earlier one.

    python -m benchmarks.learning.departures [reference|swingup|cartpole [SEEDS [ROW …]]]

`reference` departs from `original`, `swingup` from `reference`, and `cartpole` from
`cartpole-original`. Trains both presets, and the later one without each of its departures, with the
training seeds 0, 1, … (20 seeds), two runs at a time. Writes the greedy regrets on the starts of
seeds 0 to 99, with a 95 % bootstrap interval of the mean over the training seeds. With ROWs, such
as `discount`, it trains only these and keeps the other rows of the last results. On two cores,
`reference` takes twenty minutes, `cartpole` one hour and `swingup` three.
"""

from __future__ import annotations

import sys
from dataclasses import fields, replace

import keras_pendulum as kp
from benchmarks.learning.variants import table_row, train_variants
from benchmarks.result_files import rows_of, write

BEFORE = {"reference": "original", "swingup": "reference", "cartpole": "cartpole-original"}
# The name and the task are no departures.
_NOT_COUNTED = ("preset", "gravity")
# The second setting needs the first: with an update after each step, the number of updates, which
# the cosine needs, is not known before the run.
_DEPENDENT = {("cartpole", "train_frequency"): ("learning_rate_schedule",)}


def departures(preset: str) -> list[str]:
    """Returns the settings in which a preset departs from the earlier one."""
    after, before = kp.preset(preset), kp.preset(BEFORE[preset])
    names = [spec.name for spec in fields(kp.Config) if spec.name not in _NOT_COUNTED]
    return [name for name in names if getattr(after, name) != getattr(before, name)]


def measured(preset: str) -> dict[str, list[float]]:
    """Returns the regrets in benchmarks/results, by preset and by setting that is not changed."""
    return {row["training"]: row["regrets"] for row in rows_of(f"departures_{preset}")}


def main(preset: str = "reference", seeds: str = "20", *only: str) -> None:
    """Trains every variant, or those of the rows in `only`, and writes the results."""
    after, before = kp.preset(preset), kp.preset(BEFORE[preset])
    variants = {BEFORE[preset]: replace(before, gravity=after.gravity), preset: after}
    for name in departures(preset):
        unchanged = (name, *_DEPENDENT.get((preset, name), ()))
        variants[name] = after.change(**{each: getattr(before, each) for each in unchanged})
    chosen = {name: config for name, config in variants.items() if not only or name in only}
    trained = {
        row["training"]: row for row in train_variants(chosen, range(int(seeds)), range(100))
    }
    earlier = measured(preset) if only else {}
    rows = [trained.get(name) or table_row(name, earlier[name]) for name in variants]
    write(
        f"departures_{preset}", f"python -m benchmarks.learning.departures {preset} {seeds}", rows
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
