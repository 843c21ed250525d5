"""The training of several settings with several seeds, and their regrets in a table."""

from __future__ import annotations

import multiprocessing
from dataclasses import replace
from functools import partial
from multiprocessing.pool import Pool

import keras_pendulum as kp
from benchmarks.learning.regrets import mean_and_interval
from benchmarks.result_files import Row


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


def train_variants(variants: dict[str, kp.Config], seeds: range, starts: range) -> list[Row]:
    """Trains each variant with each of the seeds, two runs at a time; returns a row for each."""
    rows: list[Row] = []
    with two_processes() as pool:
        for name, config in variants.items():
            configs = [replace(config, seed=seed) for seed in seeds]
            regrets = pool.map(partial(regret, starts=starts), configs, 1)
            rows.append(table_row(name, regrets))
            print(f"{name:25} {regrets}", flush=True)
    return rows
