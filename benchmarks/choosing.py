"""The updates of `reference` beside settings not taken, on seeds that no result is reported for.

    python -m benchmarks.choosing [SEEDS ["NAME: PRESET field=value …" …]]

Trains arms with the training seeds 100, 101, … (16 seeds), two runs at a time, and evaluates each
run greedily on the starts of seeds 1000 to 1299. Arms are written as for the study; the default
ones are those of README.md. It takes ten minutes on two cores.
"""

from __future__ import annotations

import sys

from benchmarks.departures import train_variants
from benchmarks.report import write
from keras_pendulum.study.arms import own_arms

ARMS = (
    "30 updates: reference",
    "22 updates: reference updates_per_episode=22",
    "24 updates of 2e-3: reference updates_per_episode=24 learning_rate=2e-3",
    "22 updates with Huber's loss: reference updates_per_episode=22 loss=huber",
    "30 updates from PyTorch's initial weights: reference initial_weights=fan-in",
)


def main(seeds: str = "16", *texts: str) -> None:
    """Trains every arm; writes the results of the default ones."""
    variants = {arm.name: arm.config for arm in own_arms([], texts or ARMS)}
    rows = train_variants(variants, range(100, 100 + int(seeds)), range(1000, 1300))
    if not texts:
        write("choosing", f"python -m benchmarks.choosing {seeds}", rows)


if __name__ == "__main__":
    main(*sys.argv[1:])
