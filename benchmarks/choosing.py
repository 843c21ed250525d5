"""How the updates of `reference` were chosen: by seeds that no result is reported on.

    python -m benchmarks.choosing [SEEDS ['NAME: PRESET field=value …' …]]

Trains arms, written as for the study (by default those that README gives figures for), with the
training seeds 100, 101, … (16 seeds), two at a time, and evaluates each greedily on the starts of
seeds 1000 to 1299. Eight minutes on two cores.
"""

from __future__ import annotations

import sys

from benchmarks.departures import trained
from benchmarks.report import write
from keras_pendulum.arms import own_arms

# When they were compared, the updates still came between the episodes.
_REFERENCE = "reference update_after=episode"
ARMS = (
    f"30 updates: {_REFERENCE}",
    f"22 updates: {_REFERENCE} updates_per_episode=22",
    f"24 updates of 2e-3: {_REFERENCE} updates_per_episode=24 learning_rate=2e-3",
    f"22 updates with Huber's loss: {_REFERENCE} updates_per_episode=22 loss=huber",
    f"30 updates from PyTorch's initial weights: {_REFERENCE} initial_weights=fan-in",
)


def main(seeds: str = "16", *texts: str) -> None:
    """Trains every arm; writes the results of the default ones."""
    variants = {arm.name: arm.config for arm in own_arms([], texts or ARMS)}
    rows = trained(variants, range(100, 100 + int(seeds)), range(1000, 1300))
    if not texts:
        write("choosing", f"python -m benchmarks.choosing {seeds}", rows)


if __name__ == "__main__":
    main(*sys.argv[1:])
