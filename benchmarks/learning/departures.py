"""The value of each setting in which a preset departs from an earlier one.

    python -m benchmarks.learning.departures FOLDER swingup|cartpole [SEEDS]

`swingup` departs from `reference`, and `cartpole` from `cartpole-original`. Trains both presets,
and the later one without each of its departures, with the training seeds 0, 1, … (10 seeds), two
runs at a time. Writes the greedy regrets on the starts of seeds 0 to 99, of CartPole on those of 0
to 999, with their interquartile mean. The command may be stopped and started again: the regrets in
FOLDER/regrets.jsonl are used again. After a change of a preset, it trains only the rows whose
settings are others; after a change of the training, remove the file. On two cores, `cartpole` takes
half an hour and `swingup` an hour and a half.
`reference` departs from `original`: its rows are arms of the study, so
`benchmarks.learning.study` trains them.
"""

from __future__ import annotations

import re
import sys
from dataclasses import fields, replace

import keras_pendulum as kp
from benchmarks.learning.study import table
from benchmarks.learning.variants import train_variants
from benchmarks.result_files import rows_of, write

BEFORE = {"reference": "original", "swingup": "reference", "cartpole": "cartpole-original"}
MEASURED_HERE = ("swingup", "cartpole")
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
    """Returns the regrets in the results, by preset and by setting that is not changed."""
    if preset == "reference":
        return _measured_by_the_study()
    return {row["training"]: row["regrets"] for row in rows_of(f"departures_{preset}")}


def _measured_by_the_study() -> dict[str, list[float]]:
    """Returns the regrets of the study's arms `original`, `reference` and `reference without …`."""
    regrets = {row["arm"]: row["regrets"] for row in table()["rows"]}
    without = {
        found[1]: regrets[arm]
        for arm in regrets
        if (found := re.match(r"reference without (\w+)", arm))
    }
    return {name: regrets[name] for name in ("reference", "original")} | without


def main(folder: str, preset: str, seeds: str = "10") -> None:
    """Trains every variant that the folder does not have; writes the results."""
    if preset not in MEASURED_HERE:
        raise SystemExit(f"error: {preset}: expected one of {', '.join(MEASURED_HERE)}")
    after, before = kp.preset(preset), kp.preset(BEFORE[preset])
    variants = {BEFORE[preset]: replace(before, gravity=after.gravity), preset: after}
    for name in departures(preset):
        unchanged = (name, *_DEPENDENT.get((preset, name), ()))
        variants[name] = after.change(**{each: getattr(before, each) for each in unchanged})
    starts = range(100 if after.task.never_terminates else 1000)
    rows = train_variants(variants, range(int(seeds)), starts, folder)
    command = f"python -m benchmarks.learning.departures FOLDER {preset} {seeds}"
    write(f"departures_{preset}", command, rows)


if __name__ == "__main__":
    main(*sys.argv[1:])
