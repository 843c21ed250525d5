"""What each departure of `reference` from the original is worth: learning without it.

    python -m benchmarks.departures

Trains `original`, `reference`, and `reference` with one departure taken back at a time, with five
seeds each, and writes the greedy regrets (reset seeds 0 to 99) to benchmarks/departures.json, from
which README's table of departures takes its figures. Five minutes on two cores.
"""

from __future__ import annotations

import json
import multiprocessing
from dataclasses import fields, replace
from pathlib import Path

import keras_pendulum as kp

RESULTS = Path(__file__).with_suffix(".json")
SEEDS = range(5)


def departures() -> list[str]:
    """The settings in which `reference` differs from `original`."""
    ours, theirs = kp.preset("reference"), kp.preset("original")
    names = [spec.name for spec in fields(kp.Config) if spec.name != "preset"]
    return [name for name in names if getattr(ours, name) != getattr(theirs, name)]


def regret(config: kp.Config) -> float:
    """Greedy regret after one training, rounded to 0.1."""
    return round(kp.evaluate_policy(kp.train_dqn(config).network).regret, 1)


def main() -> None:
    """Trains every variant and writes the results."""
    original, reference = kp.preset("original"), kp.preset("reference")
    variants = {"original": original, "reference": reference}
    for name in departures():
        variants[name] = replace(reference, **{name: getattr(original, name)})
    results = {}
    # Fresh processes, because TensorFlow does not survive a fork.
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        for name, config in variants.items():
            results[name] = pool.map(regret, [replace(config, seed=seed) for seed in SEEDS], 1)
            print(f"{name:25} {results[name]}", flush=True)
    RESULTS.write_text(json.dumps(results, indent=2) + "\n")


if __name__ == "__main__":
    main()
