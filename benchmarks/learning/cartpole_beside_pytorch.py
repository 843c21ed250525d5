"""The CartPole agent of this package and that of the PyTorch notebooks: speed and learning curves.

    python -m benchmarks.learning.cartpole_beside_pytorch [SEEDS]

Trains the preset `cartpole-original` and the notebooks' program (tests/torch/torch_cartpole.py,
extra `test`) for 150 episodes with the seeds 0, 1, … (5 seeds). Each run is a process, and the
programs run in turns. The speed is that of the training loop without its first 20 episodes, in
which the update is compiled. The learning curves are mean returns of 30 episodes each. It takes a
minute.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator
from typing import Any

import numpy as np

from benchmarks.result_files import ROOT, versions, write
from benchmarks.speed.processes import in_turns, median, run_process

EPISODES = 150
BLOCK = 30  # episodes
UNTIMED = 20  # episodes; the first update is one of theirs
COMMAND = "python -m benchmarks.learning.cartpole_beside_pytorch"
PROGRAMS = {"here": "this package, `cartpole-original`", "torch": "the notebooks' program, PyTorch"}


def train_here(seed: int) -> Iterator[int]:
    """Trains this package's agent; yields the number of steps of each episode."""
    import keras_pendulum as kp
    from keras_pendulum.train.loop import train_episodes
    from keras_pendulum.train.run import make_run

    run = make_run(kp.preset("cartpole-original", seed=seed, episodes=EPISODES))
    for record in train_episodes(run):
        yield int(record.episode_return)


def train_torch(seed: int) -> Iterator[int]:
    """Trains the PyTorch program's agent; yields the number of steps of each episode."""
    sys.path.insert(0, str(ROOT / "tests" / "torch"))
    import torch
    import torch_agent
    import torch_cartpole

    torch.manual_seed(seed)
    agent = torch_cartpole.Agent(torch_agent.to_keras(torch_cartpole.network()))
    for actions in torch_cartpole.train_episodes(agent, seed, EPISODES):
        yield len(actions)


def measure(program: str, seed: int) -> None:
    """Trains in this process; prints the returns and the steps per second as JSON."""
    returns = []
    for steps in {"here": train_here, "torch": train_torch}[program](seed):
        returns.append(steps)
        if len(returns) == UNTIMED:
            started = time.perf_counter()
    rate = sum(returns[UNTIMED:]) / (time.perf_counter() - started)
    print(json.dumps({"returns": returns, "rate": rate}))


def measure_in_process(program: str, seed: int) -> dict[str, Any]:
    """Trains in another process; returns its returns and its steps per second."""
    module = "benchmarks.learning.cartpole_beside_pytorch"
    output = run_process("-m", module, program, str(seed)).output
    measured: dict[str, Any] = json.loads(output.splitlines()[-1])
    print(f"{program} seed {seed}: {measured['rate']:.0f} steps/s", flush=True)
    return measured


def main(seeds: int = 5) -> None:
    """Makes all runs and writes the two tables."""
    runs = in_turns(PROGRAMS, measure_in_process, seeds)
    rates = {name: median([run["rate"] for run in runs[name]]) for name in PROGRAMS}
    speed = [
        {
            "program": PROGRAMS[name],
            "environment steps per second": round(rates[name]),
            "times as fast": round(rates[name] / rates["torch"], 1),
            "runs": seeds,
        }
        for name in PROGRAMS
    ]
    write("cartpole_speed", COMMAND, speed, also=versions(["torch"]))
    shape = seeds, EPISODES // BLOCK, BLOCK
    blocks = {  # [seeds, blocks]
        name: np.mean(np.reshape([run["returns"] for run in runs[name]], shape), axis=2)
        for name in PROGRAMS
    }
    curves = []
    for i in range(EPISODES // BLOCK):
        keras, torch = (blocks[name][:, i] for name in PROGRAMS)
        deviation = float(np.hypot(keras.std(ddof=1), torch.std(ddof=1)))
        curves.append(
            {
                "episodes": f"{i * BLOCK} to {(i + 1) * BLOCK - 1}",
                "here": f"{keras.mean():.1f} ± {keras.std(ddof=1):.1f}",
                "PyTorch": f"{torch.mean():.1f} ± {torch.std(ddof=1):.1f}",
                "difference in standard deviations": round(
                    abs(keras.mean() - torch.mean()) / deviation, 2
                ),
            }
        )
    write("cartpole_learning", COMMAND, curves, also=versions(["torch"]))


if __name__ == "__main__":
    if sys.argv[1:2] in (["here"], ["torch"]):
        measure(sys.argv[1], int(sys.argv[2]))
    else:
        main(*map(int, sys.argv[1:]))
