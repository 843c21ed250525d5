"""What each setting in which a preset departs from the one before it is worth.

    python -m benchmarks.departures [reference|swingup|cartpole [SEEDS]]

Trains `reference`, which departs from `original`, `swingup`, which departs from `reference`, or
`cartpole`, which departs from `cartpole-original`: as it is, and with one departure taken back at a
time, with the training seeds 0, 1, … (5 seeds), two at a time. Greedy regrets on the starts of
seeds 0 to 99 go to benchmarks/results, from which README's tables of departures take their
figures. `reference` takes five minutes on two cores, `swingup` three for each seed and departure.
"""

from __future__ import annotations

import json
import multiprocessing
import sys
from dataclasses import fields, replace
from functools import partial

import keras_pendulum as kp
from benchmarks.report import RESULTS, Row, best_mean_return, write

BEFORE = {"reference": "original", "swingup": "reference", "cartpole": "cartpole-original"}
# The task itself is no departure, and the name none either.
_NOT_COUNTED = ("preset", "gravity")
# What makes no sense without a departure is taken back with it: after each step it is not known
# how many updates there will be for a cosine to fall over.
_TAKEN_BACK_TOO = {("cartpole", "update_after"): ("learning_rate_schedule",)}


def departures(preset: str) -> list[str]:
    """The settings in which a preset differs from the one before it."""
    ours, theirs = kp.preset(preset), kp.preset(BEFORE[preset])
    names = [spec.name for spec in fields(kp.Config) if spec.name not in _NOT_COUNTED]
    return [name for name in names if getattr(ours, name) != getattr(theirs, name)]


def measured(preset: str) -> dict[str, list[float]]:
    """The regrets of the last measurement, by what was taken back; the presets by their names."""
    rows = json.loads((RESULTS / f"departures_{preset}.json").read_text())["rows"]
    return {row["training"]: row["regrets"] for row in rows}


def regret(config: kp.Config, starts: range) -> float:
    """Greedy regret after one training, rounded to 0.1."""
    network = kp.train_dqn(config).network
    score = kp.evaluate_policy(network, episodes=len(starts), seed=starts[0])
    return round(best_mean_return(score) - score.mean_return, 1)


def trained(variants: dict[str, kp.Config], seeds: range, starts: range) -> list[Row]:
    """A row for each variant, trained with all of `seeds`, two at a time."""
    rows: list[Row] = []
    # Fresh processes, because TensorFlow does not survive a fork.
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        for name, config in variants.items():
            configs = [replace(config, seed=seed) for seed in seeds]
            regrets = pool.map(partial(regret, starts=starts), configs, 1)
            rows.append(
                {
                    "training": name,
                    "mean regret": round(sum(regrets) / len(regrets), 1),
                    "worst regret": max(regrets),
                    "regrets": regrets,
                }
            )
            print(f"{name:25} {regrets}", flush=True)
    return rows


def main(preset: str = "reference", seeds: str = "5") -> None:
    """Trains every variant and writes the results."""
    ours, theirs = kp.preset(preset), kp.preset(BEFORE[preset])
    variants = {BEFORE[preset]: replace(theirs, gravity=ours.gravity), preset: ours}
    for name in departures(preset):
        back = (name, *_TAKEN_BACK_TOO.get((preset, name), ()))
        variants[name] = replace(ours, **{each: getattr(theirs, each) for each in back})
    rows = trained(variants, range(int(seeds)), range(100))
    write(f"departures_{preset}", f"python -m benchmarks.departures {preset} {seeds}", rows)


if __name__ == "__main__":
    main(*sys.argv[1:])
