"""The CartPole agent here and in PyTorch: how fast, and whether both learn alike.

    python -m benchmarks.cartpole [SEEDS]

Trains the preset `cartpole-original` and the notebooks' program (tests/torch_cartpole.py, extra
`bench`) for 150 episodes with each of the seeds 0, 1, … (5), each run a process of its own, in
turns. Environment steps a second are those of the training loop from the first update on, without
the compilation here. Learning curves are mean returns of blocks of 30 episodes.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.report import median, run_process, versions, write

EPISODES = 150
BLOCK = 30
WARM_UP = 20  # episodes; updates begin within them
PROGRAMS = {"here": "this package, `cartpole-original`", "torch": "the notebooks' program, PyTorch"}


def run_here(seed: int) -> Iterator[int]:
    """The steps of each episode of this package's run."""
    import keras_pendulum as kp
    from keras_pendulum.run import Run

    run = Run(kp.preset("cartpole-original", seed=seed, episodes=EPISODES))
    for record in run.episodes():
        yield int(record.episode_return)


def run_torch(seed: int) -> Iterator[int]:
    """The steps of each episode of the PyTorch program."""
    sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
    import torch
    import torch_cartpole

    torch.manual_seed(seed)
    learner = torch_cartpole.Learner(torch_cartpole.to_keras(torch_cartpole.network()))
    for actions in torch_cartpole.episodes(learner, seed, EPISODES):
        yield len(actions)


def measure(program: str, seed: int) -> None:
    """One run in this process; prints its returns and its steps a second."""
    returns = []
    for steps in {"here": run_here, "torch": run_torch}[program](seed):
        returns.append(steps)
        if len(returns) == WARM_UP:
            started = time.perf_counter()
    rate = sum(returns[WARM_UP:]) / (time.perf_counter() - started)
    print(json.dumps({"returns": returns, "rate": rate}))


def main(seeds: int = 5) -> None:
    """Runs all in turns and writes the two tables."""
    returns: dict[str, list[list[int]]] = {name: [] for name in PROGRAMS}
    rates: dict[str, list[float]] = {name: [] for name in PROGRAMS}
    for seed in range(seeds):
        for name in PROGRAMS:
            output = run_process("-m", "benchmarks.cartpole", name, str(seed)).output
            measured = json.loads(output.splitlines()[-1])
            returns[name].append(measured["returns"])
            rates[name].append(measured["rate"])
            print(f"{name} seed {seed}: {measured['rate']:.0f} steps/s", flush=True)
    speed = [
        {
            "program": PROGRAMS[name],
            "environment steps a second": round(median(rates[name])),
            "times as fast": round(median(rates[name]) / median(rates["torch"]), 1),
            "runs": seeds,
        }
        for name in PROGRAMS
    ]
    write("cartpole_speed", "python -m benchmarks.cartpole", speed, also=versions(["torch"]))
    blocks = {  # [seeds, blocks]
        name: np.mean(np.reshape(runs, (seeds, EPISODES // BLOCK, BLOCK)), axis=2)
        for name, runs in returns.items()
    }
    curves = []
    for i in range(EPISODES // BLOCK):
        ours, theirs = (blocks[name][:, i] for name in PROGRAMS)
        spread = float(np.hypot(ours.std(ddof=1), theirs.std(ddof=1)))
        curves.append(
            {
                "episodes": f"{i * BLOCK} to {(i + 1) * BLOCK - 1}",
                "here": f"{ours.mean():.1f} ± {ours.std(ddof=1):.1f}",
                "PyTorch": f"{theirs.mean():.1f} ± {theirs.std(ddof=1):.1f}",
                "difference in spreads": round(abs(ours.mean() - theirs.mean()) / spread, 2),
            }
        )
    write("cartpole_learning", "python -m benchmarks.cartpole", curves, also=versions(["torch"]))


if __name__ == "__main__":
    if sys.argv[1:2] in (["here"], ["torch"]):
        measure(sys.argv[1], int(sys.argv[2]))
    else:
        main(*map(int, sys.argv[1:]))
