"""The pictures of docs/my_dqn_does_not_learn.md: the diagnosis of a network with each fault.

    python -m benchmarks.pages.fault_pictures FOLDER

Trains the networks in FOLDER, as `benchmarks.diagnosis.single_faults` does, and writes
docs/faults/FAULT.png. It takes a minute.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

from benchmarks.diagnosis.faults import ACTING, TRAINING
from benchmarks.diagnosis.labelled_networks import FAULTS, Case, measurement_of, train_case
from benchmarks.result_files import ROOT

PICTURES = ROOT / "docs" / "faults"


def picture_cases() -> dict[str, Case]:
    """Returns a healthy network, and one with the first variant of each fault, by name."""
    cases = {"healthy": Case((), 1.0, (64, 64), "tanh", 300)}
    for fault in FAULTS:
        variant = next(iter((TRAINING | ACTING)[fault]))
        cases[fault] = replace(cases["healthy"], faults=((fault, variant),))
    return cases


def main(folder: str) -> None:
    """Writes the pictures."""
    from keras_pendulum.diagnosis.diagnose import diagnose_measurement

    PICTURES.mkdir(exist_ok=True)
    for name, case in picture_cases().items():
        checkpoint = train_case(case, Path(folder))
        measurement = measurement_of(case, checkpoint, recorded=bool(case.trainings))
        measurement.policy.name = "Network"
        diagnosis = diagnose_measurement(measurement)
        diagnosis.figure().savefig(PICTURES / f"{name}.png", dpi=64)
        print(diagnosis.verdict)


if __name__ == "__main__":
    main(*sys.argv[1:])
