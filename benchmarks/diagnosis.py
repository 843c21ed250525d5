"""How often a diagnosis names the true fault of a network first.

    python -m benchmarks.diagnosis FOLDER [FIRST_SEED ROUNDS]

Trains the labelled networks of `benchmarks.faults` in FOLDER: one of each fault in each round, with
the seeds 500, 501, … (20 rounds). Thresholds were set on the seeds 300 to 399 only. Each network is
diagnosed alone; one with a fault of the training is diagnosed with its run's record, too. The
command may be stopped and started again: networks and diagnoses in FOLDER are used again. Remove
FOLDER/diagnoses.jsonl after a change of the rules. A round took eight minutes on a busy machine.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.faults import ACTING, TRAINING, Case, cases, subject_of, train_case
from benchmarks.report import RESULTS, Row, write

HEALTHY = "healthy"
FAULTS = [fault for fault in TRAINING | ACTING if fault != HEALTHY]
COLUMNS = [*FAULTS, "undetermined", "no finding"]


def diagnose_case(case: Case, folder: Path) -> dict[str, Any]:
    """Returns the findings on a case's network, and with its run's record where that knows more."""
    from keras_pendulum.diagnose.diagnosis import diagnose_subject
    from keras_pendulum.diagnose.run_folder import read_record

    checkpoint = train_case(case, folder)
    subject = subject_of(case, checkpoint)
    alone = diagnose_subject(subject)
    result = {
        "case": asdict(case),
        "regret": round(alone.measurement.regret, 2),
        "little": round(alone.measurement.little, 2),
        "network": [finding.name for finding in alone.findings],
        "notes": [finding.name for finding in alone.notes],
        "run": None,
    }
    if case.fault in TRAINING:
        record = replace(read_record(checkpoint), config=case.declared)
        result["run"] = [finding.name for finding in diagnose_subject(subject, record).findings]
    return result


def named(result: dict[str, Any], kind: str) -> str:
    """Returns the first finding of a result, or "no finding"."""
    findings = result[kind] if result[kind] is not None else result["network"]
    return findings[0] if findings else "no finding"


def is_fault(result: dict[str, Any]) -> bool:
    """Returns whether the fault costs more than what counts as little."""
    return bool(result["regret"] > result["little"])


def summarize(results: list[dict[str, Any]]) -> list[Row]:
    """Returns a row for each fault, and one for the healthy networks."""
    rows: list[Row] = []
    for fault in [*FAULTS, HEALTHY]:
        own = [result for result in results if result["case"]["fault"] == fault]
        costly = [result for result in own if is_fault(result) or fault == HEALTHY]
        expected = "no finding" if fault == HEALTHY else fault
        wrong = Counter(named(result, "run") for result in costly)
        right = wrong.pop(expected, 0)
        alone = sum(named(result, "network") == expected for result in costly)
        harmless = [result for result in own if result not in costly]
        rows.append(
            {
                "fault": fault,
                "runs": len(costly),
                "named first": _share(right, len(costly)),
                "named from the network alone": _share(alone, len(costly)),
                "instead": ", ".join(f"{name} {count}" for name, count in wrong.items()) or "–",
                "costs little: named in a note": _share(
                    sum(fault in result["notes"] for result in harmless), len(harmless)
                ),
            }
        )
    return rows


def _share(count: int, total: int) -> str:
    return f"{count} of {total}" if total else "–"


def confusion(results: list[dict[str, Any]]) -> NDArray[np.intp]:
    """Returns how often each fault (row; healthy is last) got each first finding (column)."""
    matrix = np.zeros((len(FAULTS) + 1, len(COLUMNS)), np.intp)
    for result in results:
        fault = result["case"]["fault"]
        if is_fault(result) or fault == HEALTHY:
            matrix[[*FAULTS, HEALTHY].index(fault), COLUMNS.index(named(result, "run"))] += 1
    return matrix


def draw(results: list[dict[str, Any]], path: Path) -> None:
    """Draws the confusion matrix."""
    from matplotlib.figure import Figure

    matrix = confusion(results)
    share = matrix / np.maximum(matrix.sum(axis=1, keepdims=True), 1)
    figure = Figure(figsize=(10, 8.5), layout="constrained")
    axes = figure.subplots()
    axes.imshow(share, cmap="Blues", vmin=0, vmax=1)
    for (row, column), count in np.ndenumerate(matrix):
        if count:
            color = "white" if share[row, column] > 0.6 else "black"
            axes.text(column, row, str(count), ha="center", va="center", color=color)
    axes.set_xticks(range(len(COLUMNS)), COLUMNS, rotation=60, ha="right")
    axes.set_yticks(range(len(FAULTS) + 1), [*FAULTS, HEALTHY])
    axes.set_xlabel("First finding")
    axes.set_ylabel("Fault")
    figure.savefig(path, dpi=80)


def main(folder: str, first_seed: str = "500", rounds: str = "20") -> None:
    """Trains, diagnoses and writes the results."""
    import keras

    path = Path(folder)
    path.mkdir(parents=True, exist_ok=True)
    file = path / "diagnoses.jsonl"
    lines = file.read_text("utf-8").splitlines() if file.exists() else []
    known = {json.dumps(json.loads(line)["case"]): json.loads(line) for line in lines}
    results = []
    for case in cases(range(int(first_seed), int(first_seed) + int(rounds))):
        key = json.dumps(asdict(case))
        if key not in known:
            known[key] = diagnose_case(case, path)
            with file.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps(known[key]) + "\n")
            keras.backend.clear_session()
            print(case.fault, case.variant, known[key]["run"] or known[key]["network"], flush=True)
        results.append(known[key])
    draw(results, RESULTS / "diagnosis.png")
    command = f"python -m benchmarks.diagnosis FOLDER {first_seed} {rounds}"
    write("diagnosis", command, summarize(results))


if __name__ == "__main__":
    main(*sys.argv[1:])
