"""The blocks of README.md and docs about the study, its cost and its limits."""

from __future__ import annotations

from benchmarks.learning.departures import departures
from benchmarks.learning.regrets import STATISTIC, number
from benchmarks.learning.study import table
from benchmarks.result_files import markdown, rows_of
from keras_pendulum.study.arms import default_arms, describe_setting


def steps() -> str:
    """Returns the regrets of the study's arms from `original` to `reference`, in one paragraph."""
    arms = {arm["arm"]: number(arm["regret_iqm"]) for arm in table()["rows"]}
    changes = []
    for name, regret in arms.items():
        setting, equals, value = name.removeprefix("+ ").partition("=")
        if name.startswith("+ ") and equals:
            label = describe_setting(setting, int(value) if value.isdecimal() else value)
            changes.append(f"{regret} ({label})")
    (last,) = [arm.label for arm in default_arms() if arm.name == "reference"]
    label = last.removeprefix("+ ").removesuffix(" = reference")
    changes.append(f"{arms['reference']} ({label})")
    return (
        "The main fault is **one update per 200 steps**. Here and in the table, the regret of a "
        f"program is the {STATISTIC}. It is {arms['original']} for the original, from "
        f"{table()['rows'][0]['runs']} seeds. With one change after the other it is "
        f"{', '.join(changes[:-1])} and {changes[-1]}.\n"
    )


def study_table() -> str:
    """Returns the study's table without its wide columns, and with which version it was made."""
    rows = [
        {
            "arm": arm["arm"],
            "regret": number(arm["regret_iqm"]),
            "95 % interval": f"{number(arm['regret_low'])} to {number(arm['regret_high'])}",
            "worst": number(arm["regret_worst"]),
            "discount alone": number(arm["discount_regret"]),
        }
        for arm in table()["rows"]
    ]
    runs = {str(arm["runs"]) for arm in table()["rows"]}
    arms = " ".join(row["arm"] for row in rows)
    unknown = [name for name in departures("reference") if f"without {name}" not in arms]
    note = (
        f" The present `reference` also changes {', '.join(f'`{name}`' for name in unknown)}, "
        "which that version did not: see [the presets](presets.md)."
        if unknown
        else ""
    )
    return (
        f"{' or '.join(sorted(runs))} seeds for each arm, made by keras_pendulum "
        f"{table()['versions']['keras_pendulum']}.{note}\n\n{markdown(rows)}"
    )


def study_arm(name: str) -> str:
    """Returns the regret of an arm with its interval."""
    arm = next(arm for arm in table()["rows"] if arm["arm"] == name)
    low, high = number(arm["regret_low"]), number(arm["regret_high"])
    return f"{number(arm['regret_iqm'])} ({low} to {high})"


def exercise_updates() -> str:
    """Returns the expected regrets of the first exercise."""
    change = next(arm["arm"] for arm in table()["rows"] if arm["arm"].startswith("+ updates"))
    return (
        f"Expected: {study_arm('original')} without the change, {study_arm(change)} with "
        f"`{change.removeprefix('+ ')}`, as interquartile mean and 95 % interval over the seeds of "
        "the study.\n"
    )


def exercise_indices() -> str:
    """Returns the expected regret of the second exercise."""
    return (
        f"Expected: {study_arm('reference with index-truncation')} instead of "
        f"{study_arm('reference')}.\n"
    )


def study_cost() -> str:
    """Returns the cost of a study's run, and what follows for more cores."""
    one, two = rows_of("study_cost")
    per_core_hour = two["runs per core-hour"]
    rows = [
        {
            "cores": cores,
            "time for 10 000 runs": _hours(10_000 / per_core_hour / cores),
            "runs per second": f"{per_core_hour * cores / 3600:.2g}",
        }
        for cores in (1, 16, 1000)
    ]
    return (
        f"One worker makes {one['runs per core-hour']:.0f} runs of `reference` per hour, two make "
        f"{2 * per_core_hour:.0f}. These are **{per_core_hour:.0f} runs per core-hour, an "
        f"efficiency of {two['efficiency']:.2f}**. Two processes that only multiply matrices reach "
        f"{two['efficiency of matrix products']:.2f}. With two workers a run takes "
        f"{two['training (s per run)']:.1f} s of training and "
        f"{two['evaluation (s per run)']:.1f} s of evaluation. With one worker the overhead is "
        f"{one['overhead (s per run)']:.2f} s per run. The start of a worker takes "
        f"{two['start of a worker (s, once)']:.1f} s, once. From these numbers:\n\n"
        f"{markdown(rows)}"
    )


def _hours(hours: float) -> str:
    return f"{hours:.2g} hours" if hours >= 1 else f"{60 * hours:.0f} minutes"


def study_scale() -> str:
    """Returns the limits of a study, measured with empty runs."""
    (row,) = rows_of("study_scale")
    run = 3600 / rows_of("study_cost")[1]["runs per core-hour"]  # s of a core
    answered, written = row["answered (runs/s)"], row["answered and written (runs/s)"]
    lines = (
        f"**Scheduler and study** are the first limit. They hand out {answered} empty runs per "
        f"second, and {written} if each result is written and flushed to the disk. At {run:.0f} s "
        f"per run, so many come from {100 * round(written * run / 100)} cores.",
        f"**Folder of results**: {row['runs']} results take {row['folder (MB)']} MB, in one folder "
        "per arm. To continue a study, all results are read and their checksums are compared: "
        f"{row['searched for missing runs (s)']} s.",
        "**Memory** does not grow with the waiting runs: each worker gets one run at a time. The "
        f"study with {row['runs']} results needed {row['peak memory (MB)']} MB.",
        f"**Tables and figure** of {row['runs']} results take {row['table and figure (s)']} s.",
    )
    return "".join(f"- {line}\n" for line in lines)
