"""For how many of its 500 episodes the preset `original` repeats the recorded run.

python -m benchmarks.recorded_run
"""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

import keras_pendulum as kp
from keras_pendulum.run import Run

_DATA = Path(__file__).parents[1] / "tests" / "data"


def main() -> None:
    """Runs the preset and compares every episode with the record."""
    with np.load(_DATA / "original_run_seed1.npz") as arrays:
        recorded = dict(arrays)
    lines = (_DATA / "original_run_seed1.log").read_text().splitlines()
    initial = kp.DQN()
    initial.set_weights([recorded[f"initial_weight_{i}"] for i in range(8)])

    started = time.perf_counter()
    run = Run(kp.preset("original", seed=1), initial)
    identical = 0
    for record in run.episodes():
        steps = slice(record.environment_steps - 200, record.environment_steps)
        actions = run.replay.at(np.arange(len(run.replay) - 200, len(run.replay))).action
        identical += (
            identical == record.episode  # nothing counts after the first difference
            and record.line() == lines[record.episode]
            and record.average_reward == recorded["average_reward"][record.episode]
            and np.array_equal(actions, recorded["action_index"][steps])
        )
    seconds = time.perf_counter() - started

    losses = np.array([record.loss for record in run.history if not np.isnan(record.loss)])
    finals = [recorded[f"final_weight_{i}"] for i in range(8)]
    pairs = zip(run.agent.online.get_weights(), finals, strict=True)
    weights = max(np.abs(ours - theirs).max() for ours, theirs in pairs)
    print(f"identical episodes, from the first on: {identical} of {len(lines)}")
    print(
        f"largest relative difference of a loss: {np.abs(losses / recorded['loss'] - 1).max():.1e}"
    )
    print(f"largest difference of a final weight:  {weights:.1e}")
    print(f"time of the run: {seconds:.1f} s")


if __name__ == "__main__":
    main()
