"""What each departure of `reference` from the original is worth: learning without it.

    python -m benchmarks.departures

Trains `original`, `reference`, and `reference` with one departure taken back at a time, with the
seeds 0, 1 and 2, and writes the greedy regrets (reset seeds 0 to 99) to benchmarks/departures.json,
from which README's table of departures takes its figures. About 6 minutes on two cores.
"""

from __future__ import annotations

import json
from dataclasses import fields, replace
from pathlib import Path

import keras_pendulum as kp

RESULTS = Path(__file__).with_suffix(".json")
SEEDS = (0, 1, 2)


def departures() -> list[str]:
    """The settings in which `reference` differs from `original`."""
    ours, theirs = kp.preset("reference"), kp.preset("original")
    names = [spec.name for spec in fields(kp.Config) if spec.name != "preset"]
    return [name for name in names if getattr(ours, name) != getattr(theirs, name)]


def regrets(config: kp.Config) -> list[float]:
    """Greedy regret of one training for each seed, rounded to 0.1."""
    networks = [kp.train_dqn(replace(config, seed=seed)).network for seed in SEEDS]
    return [round(kp.evaluate_policy(network).regret, 1) for network in networks]


def main() -> None:
    """Trains every variant and writes the results."""
    original = kp.preset("original")
    variants = {"original": original, "reference": kp.preset("reference")}
    for name in departures():
        variants[name] = kp.preset("reference", **{name: getattr(original, name)})
    results = {}
    for name, config in variants.items():
        results[name] = regrets(config)
        print(f"{name:25} {results[name]}", flush=True)
    RESULTS.write_text(json.dumps(results, indent=2) + "\n")


if __name__ == "__main__":
    main()
