"""The value of each setting in which a preset departs from an earlier one.

    python -m benchmarks.departures [reference|swingup|cartpole [SEEDS [ROW …]]]

`reference` departs from `original`, `swingup` from `reference`, and `cartpole` from
`cartpole-original`. Trains both presets, and the later one without each of its departures, with the
training seeds 0, 1, … (20 seeds), two runs at a time. Writes the greedy regrets on the starts of
seeds 0 to 99, with a 95 % bootstrap interval of the mean over the training seeds. With ROWs, such
as `discount`, it trains only these and keeps the other rows of the last results. On two cores,
`reference` takes twenty minutes, `cartpole` one hour and `swingup` three.
"""

from __future__ import annotations

import json
import multiprocessing
import sys
from collections.abc import Sequence
from dataclasses import fields, replace
from functools import partial

import numpy as np

import keras_pendulum as kp
from benchmarks.report import RESULTS, Row, write

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
    rows = json.loads((RESULTS / f"departures_{preset}.json").read_text("utf-8"))["rows"]
    return {row["training"]: row["regrets"] for row in rows}


def regret(config: kp.Config, starts: range) -> float:
    """Trains; returns the greedy regret on the starts of these seeds, rounded to 0.01."""
    network = kp.train_dqn(config).network
    return round(kp.evaluate_policy(network, episodes=len(starts), seed=starts[0]).regret, 2)


def interval(regrets: Sequence[float]) -> str:
    """Returns the 95 % percentile-bootstrap interval of the mean, such as `1.2 to 1.5`."""
    resampled = np.random.default_rng(0).choice(regrets, (9999, len(regrets))).mean(axis=1)
    low, high = np.quantile(resampled, (0.025, 0.975))
    return f"{low:.1f} to {high:.1f}"


def table_row(name: str, regrets: list[float]) -> Row:
    """Returns the row of a variant with its regrets, one for each training seed."""
    return {
        "training": name,
        "mean regret": round(sum(regrets) / len(regrets), 2),
        "95 % interval": interval(regrets),
        "worst regret": max(regrets),
        "regrets": regrets,
    }


def train_variants(variants: dict[str, kp.Config], seeds: range, starts: range) -> list[Row]:
    """Trains each variant with each of the seeds, two runs at a time; returns a row for each."""
    rows: list[Row] = []
    # TensorFlow does not survive a fork, so the processes are spawned.
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        for name, config in variants.items():
            configs = [replace(config, seed=seed) for seed in seeds]
            regrets = pool.map(partial(regret, starts=starts), configs, 1)
            rows.append(table_row(name, regrets))
            print(f"{name:25} {regrets}", flush=True)
    return rows


def main(preset: str = "reference", seeds: str = "20", *only: str) -> None:
    """Trains every variant, or those of the rows in `only`, and writes the results."""
    after, before = kp.preset(preset), kp.preset(BEFORE[preset])
    variants = {BEFORE[preset]: replace(before, gravity=after.gravity), preset: after}
    for name in departures(preset):
        unchanged = (name, *_DEPENDENT.get((preset, name), ()))
        variants[name] = replace(after, **{each: getattr(before, each) for each in unchanged})
    chosen = {name: config for name, config in variants.items() if not only or name in only}
    trained = {
        row["training"]: row for row in train_variants(chosen, range(int(seeds)), range(100))
    }
    earlier = measured(preset) if only else {}
    rows = [trained.get(name) or table_row(name, earlier[name]) for name in variants]
    write(f"departures_{preset}", f"python -m benchmarks.departures {preset} {seeds}", rows)


if __name__ == "__main__":
    main(*sys.argv[1:])
