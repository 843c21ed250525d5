"""How often a diagnosis names the true fault of a network first.

    python -m benchmarks.diagnosis.single_faults FOLDER [FIRST_SEED ROUNDS]

Trains the networks of `benchmarks.diagnosis.labelled_networks` in FOLDER: one of each fault in each
round, with the seeds 536, 537, … (10 rounds). Limits were set on the seeds 300 to 399. Misses on
the seeds 500 to 535 led to some rules, so these seeds are not used any more. Each network is
diagnosed alone; one with a fault of the training is diagnosed with its run's record, too. The
command may be stopped and started again: networks and diagnoses in FOLDER are used again. Remove
FOLDER/single.jsonl after a change of the rules.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterable
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.diagnosis.labelled_networks import (
    FAULTS,
    Case,
    measurement_of,
    single_cases,
    train_case,
)
from benchmarks.result_files import RESULTS, Row, write
from benchmarks.resumable import Result, measure_each
from keras_pendulum.diagnosis.faults import FAULTS as TEXTS

HEALTHY = "healthy"
ROWS = [*FAULTS, HEALTHY]
COLUMNS = [*FAULTS, *sorted(set(TEXTS) - set(FAULTS)), "no finding"]


def diagnose_case(case: Case, folder: Path) -> Result:
    """Returns the findings on a case's network, and with its run's record where that knows more."""
    from keras_pendulum.diagnosis.diagnose import diagnose_measurement

    checkpoint = train_case(case, folder)
    measurement = measurement_of(case, checkpoint)
    alone = known = diagnose_measurement(measurement)
    if case.trainings or not case.actings:  # a record does not show a fault outside the run
        known = diagnose_measurement(measurement_of(case, checkpoint, recorded=True))
    return {
        "faults": case.names,
        "regret": round(measurement.regret, 2),
        "little": round(measurement.regret_tolerance, 2),
        "network": [finding.name for finding in alone.findings],
        "findings": [finding.name for finding in known.findings],
        "notes": [finding.name for finding in known.notes],
    }


def diagnose_cases(cases: Iterable[Case], folder: str, name: str) -> list[Result]:
    """Returns the results of all cases. Those in the file FOLDER/NAME.jsonl are used again."""
    items = ((case.key, partial(diagnose_case, case, Path(folder))) for case in cases)
    return measure_each(items, folder, name)


def found(result: Result, kind: str = "findings") -> list[str]:
    """Returns the findings: with the run's record where that knows more, or of the "network"."""
    findings: list[str] = result[kind]
    return findings or ["no finding"]


def fault_of(result: Result) -> str:
    """Returns the fault of a result, or "healthy"."""
    return str(result["faults"][0]) if result["faults"] else HEALTHY


def is_costly(result: Result) -> bool:
    """Returns whether the fault costs more than what counts as little."""
    # A regret that is not a number belongs to a network that is not.
    return not result["regret"] <= result["little"]


def summarize(results: list[Result]) -> list[Row]:
    """Returns a row for each fault, one for all of them, and one for the healthy networks."""
    faulty = [result for result in results if fault_of(result) != HEALTHY]
    rows = [
        _row(fault, [result for result in faulty if fault_of(result) == fault]) for fault in FAULTS
    ]
    healthy = [result for result in results if fault_of(result) == HEALTHY]
    return [*rows, _row("all faults", faulty), _row(HEALTHY, healthy)]


def _row(name: str, results: list[Result]) -> Row:
    costly = [result for result in results if is_costly(result) or name == HEALTHY]
    harmless = [result for result in results if result not in costly]

    def is_right(result: Result, kind: str) -> bool:
        fault = fault_of(result)
        return found(result, kind)[0] == ("no finding" if fault == HEALTHY else fault)

    wrong = [found(result)[0] for result in costly if not is_right(result, "findings")]
    return {
        "fault": name,
        "named first": share(sum(is_right(each, "findings") for each in costly), len(costly)),
        "from the network alone": share(
            sum(is_right(each, "network") for each in costly), len(costly)
        ),
        "instead": "–" if name == "all faults" else counts(wrong),
        "costs little": len(harmless),
        "of them named in a note": sum(fault_of(each) in each["notes"] for each in harmless),
    }


def counts(names: Iterable[str]) -> str:
    """Returns how often each name is there, the most frequent first: "not-converged 2"."""
    return ", ".join(f"{name} {count}" for name, count in Counter(names).most_common()) or "–"


def share(count: int, total: int) -> str:
    """Returns such as "19 of 20 (95 %)"."""
    return f"{count} of {total} ({count / total:.0%})".replace("%", " %") if total else "–"


def confusion(results: list[Result]) -> NDArray[np.intp]:
    """Returns how often each fault (row; healthy is last) got each first finding (column)."""
    matrix = np.zeros((len(ROWS), len(COLUMNS)), np.intp)
    for result in results:
        fault = fault_of(result)
        if is_costly(result) or fault == HEALTHY:
            matrix[ROWS.index(fault), COLUMNS.index(found(result)[0])] += 1
    return matrix


def draw(results: list[Result], path: Path) -> None:
    """Draws the confusion matrix."""
    from matplotlib.figure import Figure

    matrix = confusion(results)
    share_of_row = matrix / np.maximum(matrix.sum(axis=1, keepdims=True), 1)
    figure = Figure(figsize=(10, 8.5), layout="constrained")
    axes = figure.subplots()
    axes.imshow(share_of_row, cmap="Blues", vmin=0, vmax=1)
    for (row, column), count in np.ndenumerate(matrix):
        if count:
            color = "white" if share_of_row[row, column] > 0.6 else "black"
            axes.text(column, row, str(count), ha="center", va="center", color=color)
    axes.set_xticks(range(len(COLUMNS)), COLUMNS, rotation=60, ha="right")
    axes.set_yticks(range(len(ROWS)), ROWS)
    axes.set_xlabel("First finding")
    axes.set_ylabel("Fault")
    figure.savefig(path, dpi=80)


def main(folder: str, first_seed: str = "536", rounds: str = "10") -> None:
    """Trains, diagnoses and writes the results."""
    seeds = range(int(first_seed), int(first_seed) + int(rounds))
    results = diagnose_cases(single_cases(seeds), folder, "single")
    draw(results, RESULTS / "diagnosis.png")
    command = f"python -m benchmarks.diagnosis.single_faults FOLDER {first_seed} {rounds}"
    write("diagnosis", command, summarize(results))


if __name__ == "__main__":
    main(*sys.argv[1:])
