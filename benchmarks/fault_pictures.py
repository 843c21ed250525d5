"""The pictures of docs/my_dqn_does_not_learn.md: the diagnosis of a network with each fault.

    python -m benchmarks.fault_pictures FOLDER

Trains the networks in FOLDER, as `benchmarks.diagnosis` does, and writes docs/faults/FAULT.png. It
takes minutes.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

from benchmarks.faults import ACTING, TRAINING
from benchmarks.labelled_networks import FAULTS, Case, subject_of, train_case

PICTURES = Path(__file__).parent.parent / "docs" / "faults"


def picture_cases() -> dict[str, Case]:
    """Returns a healthy network, and one with the first variant of each fault, by name."""
    cases = {"healthy": Case((), 1.0, (64, 64), "tanh", 300)}
    for fault in FAULTS:
        variant = next(iter((TRAINING | ACTING)[fault]))
        cases[fault] = replace(cases["healthy"], faults=((fault, variant),))
    return cases


def main(folder: str) -> None:
    """Writes the pictures."""
    from keras_pendulum.diagnose.diagnosis import diagnose_subject
    from keras_pendulum.diagnose.run_folder import read_record

    PICTURES.mkdir(exist_ok=True)
    for name, case in picture_cases().items():
        checkpoint = train_case(case, Path(folder))
        subject = replace(subject_of(case, checkpoint), name="Network")
        record = None
        if case.trainings:
            record = replace(read_record(checkpoint), config=case.declared)
        diagnosis = diagnose_subject(subject, record)
        diagnosis.figure().savefig(PICTURES / f"{name}.png", dpi=64)
        print(diagnosis.verdict)


if __name__ == "__main__":
    main(*sys.argv[1:])
