"""The training of several settings with several seeds, and their regrets in a table."""

from __future__ import annotations

import json
import multiprocessing
from dataclasses import replace
from functools import partial
from multiprocessing.pool import Pool

import keras_pendulum as kp
from benchmarks.learning.regrets import mean_and_interval
from benchmarks.result_files import Row
from benchmarks.resumable import Result, measure_each


def two_processes() -> Pool:
    """Returns two processes; each may train one run at a time."""
    # TensorFlow does not survive a fork, so the processes are spawned.
    return multiprocessing.get_context("spawn").Pool(2)


def regret(config: kp.Config, starts: range) -> float:
    """Trains; returns the greedy regret on the starts of these seeds, rounded to 0.01."""
    network = kp.train_dqn(config).network
    return round(kp.evaluate_policy(network, episodes=len(starts), seed=starts[0]).regret, 2)


def table_row(name: str, regrets: list[float]) -> Row:
    """Returns the row of a variant with its regrets, one for each training seed."""
    mean, interval = mean_and_interval(regrets)
    return {
        "training": name,
        "regret": mean,  # interquartile mean
        "95 % interval": interval,
        "worst regret": max(regrets),
        "regrets": regrets,
    }


def train_variants(
    variants: dict[str, kp.Config], seeds: range, starts: range, folder: str
) -> list[Row]:
    """Trains each variant with each of the seeds, two runs at a time; returns a row for each.

    The regrets in FOLDER/regrets.jsonl, of the same settings, seeds and starts, are used again.
    """
    with two_processes() as pool:
        items = []
        for name, config in variants.items():
            key = json.dumps([config.learning(), list(seeds), starts[0], len(starts)])
            configs = [replace(config, seed=seed) for seed in seeds]
            items.append((key, partial(_variant_regrets, name, configs, starts, pool)))
        results = measure_each(items, folder, "regrets")
    return [table_row(name, each["regrets"]) for name, each in zip(variants, results, strict=True)]


def _variant_regrets(name: str, configs: list[kp.Config], starts: range, pool: Pool) -> Result:
    return {"training": name, "regrets": pool.map(partial(regret, starts=starts), configs, 1)}
