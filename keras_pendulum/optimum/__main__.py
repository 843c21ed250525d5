"""The command `python -m keras_pendulum.optimum`: writes the files in `data/`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from keras_pendulum.cli import OneLineParser, run_command


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the command; returns its exit status."""
    parser = OneLineParser(
        prog="python -m keras_pendulum.optimum",
        description="Compute the best possible returns of the pendulum for reset seeds 0 to 9999, "
        "or with --discount those of the policy that is optimal for a discount, for seeds 0 to "
        "999, and write one file for each gravity.",
    )
    parser.add_argument("gravity", nargs="+", type=float, help="m/s², 0 to 100")
    parser.add_argument("--steps", type=int, default=200, help="steps per episode, 1 to 200 [200]")
    parser.add_argument(
        "--discount", type=float, default=1.0, help="γ of the policy, 0 to 1 [1: the best returns]"
    )
    parser.add_argument(
        "--out", type=Path, required=True, help="existing folder for the files gravity_<g>.npz"
    )
    arguments = parser.parse_args(argv)
    return run_command(lambda: _write_files(arguments))


def _write_files(arguments: argparse.Namespace) -> int:
    from keras_pendulum.environments.tasks import pendulum_starts
    from keras_pendulum.optimum.discounted import simulate_discounted, validate_discount
    from keras_pendulum.optimum.optimal_return import (
        SHIPPED_SEEDS,
        USUAL_SEEDS,
        best_return,
        validate_gravity,
        validate_steps,
    )
    from keras_pendulum.optimum.return_cache import file_name, write

    steps, discount = validate_steps(arguments.steps), validate_discount(arguments.discount)
    seeds = SHIPPED_SEEDS if discount == 1 else USUAL_SEEDS
    starts = pendulum_starts(seeds)
    for gravity in map(validate_gravity, arguments.gravity):
        if discount == 1:
            returns = best_return(gravity, starts, steps).tolist()
        else:
            returns = simulate_discounted(gravity, discount, starts, steps).tolist()
        path = arguments.out / file_name(gravity, steps, discount)
        by_seed = dict(zip(seeds, returns, strict=True))
        write(path, gravity, steps, discount, returns=by_seed)
        print(f"{path}: mean {sum(returns) / len(returns):.4f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
