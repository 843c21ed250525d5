"""How often a diagnosis has both of two faults among its first three findings.

    python -m benchmarks.diagnosis.fault_pairs FOLDER [FIRST_SEED ROUNDS]

As `benchmarks.diagnosis.single_faults`, with the same FOLDER. Each network has two faults that can
both show: one in the settings of its run, and one in its data, in how it acts, or in the settings,
too. Three rounds have all of these pairs (9 rounds). Each is diagnosed with its run's record.
Remove FOLDER/pairs.jsonl after a change of the rules.
"""

from __future__ import annotations

import sys

from benchmarks.diagnosis.labelled_networks import PAIRS, pair_cases
from benchmarks.diagnosis.single_faults import diagnose_cases, found, is_costly, share
from benchmarks.result_files import Row, write
from benchmarks.resumable import Result


def summarize(results: list[Result]) -> list[Row]:
    """Returns a row for each pair, and one for all of them."""
    costly = [result for result in results if is_costly(result)]
    rows = []
    for pair in PAIRS:
        own = [each for each in costly if _names(each) == set(pair)]
        rows.append(_row(" + ".join(pair), own))
    return [*rows, _row("all pairs", costly)]


def _row(name: str, results: list[Result]) -> Row:
    missed = [names for each in results for names in _names(each) - set(found(each)[:3])]
    return {
        "faults": name,
        "both among the first three": share(
            sum(_names(each) <= set(found(each)[:3]) for each in results), len(results)
        ),
        "missed": ", ".join(sorted(set(missed))) or "–" if name != "all pairs" else "–",
    }


def _names(result: Result) -> set[str]:
    return set(result["faults"])


def main(folder: str, first_seed: str = "500", rounds: str = "9") -> None:
    """Trains, diagnoses and writes the results."""
    seeds = range(int(first_seed), int(first_seed) + int(rounds))
    results = diagnose_cases(pair_cases(seeds), folder, "pairs")
    command = f"python -m benchmarks.diagnosis.fault_pairs FOLDER {first_seed} {rounds}"
    write("diagnosis_pairs", command, summarize(results))


if __name__ == "__main__":
    main(*sys.argv[1:])
