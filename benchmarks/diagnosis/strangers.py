"""How often a diagnosis is right about networks of programs that share no code with this package.

    python -m benchmarks.diagnosis.strangers FOLDER [ENVIRONMENT [FIRST_SEED ROUNDS]]

Trains the programs of `benchmarks.diagnosis.stranger_programs`, or with CartPole-v1 those of
`benchmarks.diagnosis.cartpole_programs`, in FOLDER: one of each mistake in each round, and two of
each right one. Each program has a seed of its own, from FIRST_SEED on. docs/diagnose.md says on
which seeds the limits of the rules were set. The command may be stopped and started again: networks
and diagnoses in FOLDER are used again. Remove FOLDER/strangers.jsonl after a change of the rules.
Needs torch. The ten rounds of the pendulum, where some mistakes cost little, take an hour and a
half, and so do the eight rounds of CartPole.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.diagnosis import stranger_programs
from benchmarks.diagnosis.cartpole_programs import CARTPOLE_MISTAKES, CARTPOLE_RIGHT
from benchmarks.diagnosis.single_faults import counts, share
from benchmarks.diagnosis.stranger_programs import Trained, make_program, train
from benchmarks.result_files import Row, write
from benchmarks.resumable import Result, measure_each

RIGHT = stranger_programs.RIGHT | CARTPOLE_RIGHT
MISTAKES = stranger_programs.MISTAKES | CARTPOLE_MISTAKES
KINDS = {
    "Pendulum-v1": [*stranger_programs.RIGHT, *stranger_programs.MISTAKES],
    "CartPole-v1": [*CARTPOLE_RIGHT, *CARTPOLE_MISTAKES],
}
FIRST_SEEDS = {"Pendulum-v1": 23000, "CartPole-v1": 9000}
ROUNDS = {"Pendulum-v1": 10, "CartPole-v1": 8}
# A rule was set after a look at these programs with lower seeds.
LOOKED_AT = {
    *stranger_programs.RIGHT,
    *(f"{which} of the next values" for which in ("mean", "minimum", "first", "last")),
}
HEALTHY = ("no finding", "not-converged")


def programs(
    first_seed: int, rounds: int, environment: str = "Pendulum-v1"
) -> Iterator[tuple[str, int]]:
    """Yields kind and seed of each program."""
    for round_ in range(rounds):
        for number, kind in enumerate(KINDS[environment]):
            seed = first_seed + 100 * number + 2 * round_ + (4000 if kind in LOOKED_AT else 0)
            yield kind, seed
            if kind in RIGHT:
                yield kind, seed + 1


def train_program(kind: str, seed: int, folder: Path) -> Trained:
    """Returns the trained program; one in the folder is used again."""
    changes = RIGHT[kind] if kind in RIGHT else MISTAKES[kind].changes
    program = make_program(changes, seed)
    path, run = program_files(kind, seed, folder)
    if not path.exists():
        import keras_pendulum as kp

        recorders: list[Any] = []

        def wrap(env: Any) -> Any:
            recorders.append(kp.Recorder(env))
            return recorders[0]

        trained = train(program, wrap)
        layers: dict[str, Any] = {
            f"layer{number:02}": array for number, array in enumerate(trained.weights)
        }
        part = path.with_suffix(".part.npz")
        part.parent.mkdir(parents=True, exist_ok=True)
        recorders[0].save(run)
        np.savez_compressed(part, **layers | trained.steps)
        part.rename(path)
    with np.load(path) as file:
        names = sorted(name for name in file.files if name.startswith("layer"))
        steps = {name: file[name] for name in file.files if name not in names}
        return Trained(program, [file[name] for name in names], steps)


def program_files(kind: str, seed: int, folder: Path) -> tuple[Path, Path]:
    """Returns the files of a program: weights and replay buffer, and what its recorder saved."""
    return folder / f"{kind}_{seed}.npz", folder / f"{kind}_{seed}_run.npz"


def diagnose_program(kind: str, seed: int, folder: Path) -> Result:
    """Returns the findings on the network of a program, with what its author declares."""
    import keras_pendulum as kp

    trained = train_program(kind, seed, folder)
    program = trained.program
    hand_in = MISTAKES[kind].hand_in if kind in MISTAKES else ()
    torques = None if program.is_cartpole else program.torques
    names = ("observation", "action", "reward", "next_observation", "terminated")
    diagnosis = kp.diagnose(
        kp.q_function(trained.q_values, torques, f"{kind} {seed}"),
        gravity=None if program.is_cartpole else program.declared_gravity or program.gravity,
        discount=program.declared_discount or program.discount,
        reward_scale=program.declared_scale,
        record=program_files(kind, seed, folder)[1] if "record" in hand_in else None,
        transitions=[trained.steps[each] for each in names] if "transitions" in hand_in else None,
    )
    measurement = diagnosis.measurement
    return {
        "kind": kind,
        "regret": round(measurement.regret, 2),
        "little": round(measurement.regret_tolerance, 2),
        "findings": [[finding.name, finding.variant] for finding in diagnosis.findings],
        "notes": [[finding.name, finding.variant] for finding in diagnosis.notes],
    }


def first(result: Result) -> str:
    """Returns the first finding, with its variant."""
    name, variant = [*result["findings"], ["no finding", ""]][0]
    return f"{name} ({variant})" if variant else name


def is_right(result: Result) -> bool:
    """Returns whether the first finding is right; of a right program, none may be named."""
    if result["kind"] in RIGHT:
        return first(result) in HEALTHY
    mistake = MISTAKES[result["kind"]]
    name, variant = [*result["findings"], ["", ""]][0]
    # Where every output is 1, no value shows whether it is `tanh or sigmoid`.
    return name == mistake.finding and mistake.variant in variant.split(" or ")


def is_harmless(result: Result) -> bool:
    """Returns whether a program with a mistake plays so well that it needs no finding."""
    return result["kind"] in MISTAKES and result["regret"] <= result["little"]


def summarize(results: list[Result]) -> list[Row]:
    """Returns a row for each kind, and one for all mistakes and for all right programs."""
    kinds = dict.fromkeys(str(result["kind"]) for result in results)
    rows = [_row(kind, [each for each in results if each["kind"] == kind]) for kind in kinds]
    wrong = [each for each in results if each["kind"] in MISTAKES]
    right = [each for each in results if each["kind"] in RIGHT]
    return [*rows, _row("all mistakes", wrong), _row("all right programs", right)]


def _row(name: str, results: list[Result]) -> Row:
    costly = [result for result in results if not is_harmless(result)]
    return {
        "program": name,
        "right first finding": share(sum(map(is_right, costly)), len(costly)),
        "instead": counts(first(each) for each in costly if not is_right(each)),
        "costs little": len(results) - len(costly),
    }


def main(
    folder: str,
    environment: str = "Pendulum-v1",
    first_seed: str | None = None,
    rounds: str | None = None,
) -> None:
    """Trains, diagnoses and writes the results."""
    first_seed = first_seed or str(FIRST_SEEDS[environment])
    rounds = rounds or str(ROUNDS[environment])
    items = (
        (f"{kind} {seed}", partial(diagnose_program, kind, seed, Path(folder)))
        for kind, seed in programs(int(first_seed), int(rounds), environment)
    )
    results = measure_each(items, folder, "strangers")
    command = f"python -m benchmarks.diagnosis.strangers FOLDER {environment} {first_seed} {rounds}"
    name = "strangers" if environment == "Pendulum-v1" else "cartpole"
    write(f"diagnosis_{name}", command, summarize(results))


if __name__ == "__main__":
    main(*sys.argv[1:])
