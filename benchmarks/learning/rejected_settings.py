"""The settings of `reference` beside others, on seeds that no result is reported for.

    python -m benchmarks.learning.rejected_settings FOLDER [SEEDS ["NAME: PRESET field=value …" …]]

Trains arms with the training seeds 100, 101, … (8 seeds), two runs at a time, and evaluates each
run greedily on the starts of seeds 1000 to 1299. Arms are written as for the study; the default
ones are those of docs/presets.md. The regrets in FOLDER/regrets.jsonl are used again: remove the
file after a change of the training. The command takes eight minutes on two cores.
"""

from __future__ import annotations

import sys

from benchmarks.learning.variants import train_variants
from benchmarks.result_files import write
from keras_pendulum.study.arms import own_arms

ARMS = (
    "reference: reference",
    "200 steps, 25 000 transitions: reference max_episode_steps=200 replay_capacity=25000",
    "the same from PyTorch's initial weights: reference max_episode_steps=200 "
    "replay_capacity=25000 initial_weights=fan-in",
    "20 000 transitions: reference replay_capacity=20000",
)


def main(folder: str, seeds: str = "8", *texts: str) -> None:
    """Trains every arm; writes the results of the default ones."""
    variants = {arm.name: arm.config for arm in own_arms([], texts or ARMS)}
    rows = train_variants(variants, range(100, 100 + int(seeds)), range(1000, 1300), folder)
    if not texts:
        write("choosing", f"python -m benchmarks.learning.rejected_settings FOLDER {seeds}", rows)


if __name__ == "__main__":
    main(*sys.argv[1:])
