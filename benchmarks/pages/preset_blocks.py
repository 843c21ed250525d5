"""The blocks of README.md and docs about the presets and their results."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import keras_pendulum as kp
from benchmarks.learning.departures import BEFORE, departures, measured
from benchmarks.learning.rejected_settings import ARMS
from benchmarks.learning.variants import interval
from benchmarks.pages.reasons import REASONS
from benchmarks.result_files import Row, markdown, rows_of
from keras_pendulum.config.fields import format_value
from keras_pendulum.config.presets import DESCRIPTIONS, PRESETS


def score() -> str:
    """Returns what `evaluate` prints for the shipped policy `reference`."""
    return fenced(printed_by("evaluate reference"))


def story() -> str:
    """Returns the table of the original, the fixed agent, the optimum and random torques."""
    original, fixed = (row_of("quality", preset=f"`{name}`") for name in ("original", "reference"))
    random_return = float(printed_by("train")[0].split(": ")[1])
    optimum = float(fixed["best possible return"])
    policies = {
        "the original program": (original["mean return"], original["mean regret"]),
        "the same design, fixed": (fixed["mean return"], fixed["mean regret"]),
        "the exact optimum": (fixed["best possible return"], "0"),
        "random torques": (f"{random_return:.1f}", f"{optimum - random_return:.1f}"),
    }
    return markdown(
        [
            {"policy": policy, "mean return": mean_return, "regret": regret}
            for policy, (mean_return, regret) in policies.items()
        ]
    )


def first_run() -> str:
    """Returns the closing lines of the first training."""
    seconds = row_of("quality", preset="`reference`")["whole command"]
    # The training evaluates its policy in the same words, and then names random actions.
    lines = printed_by("evaluate reference") + printed_by("train")
    return f"Installed, it trains in {seconds} on two cores and ends with:\n\n{fenced(lines)}"


def diagnosis() -> str:
    """Returns the first line of the diagnosis of `original`."""
    return fenced(printed_by("diagnose original")[:1])


def comparison() -> str:
    """Returns what `compare` printed."""
    lines = printed_by("compare runs/original-seed0 runs/reference-seed0")
    return "".join(f"{line}\n" for line in lines if line.startswith("|"))


def row_of(name: str, **cells: Any) -> Row:
    """Returns the first row of a result with these cells; a column's spaces are `_` here."""
    wanted = {key.replace("_", " "): value for key, value in cells.items()}
    return next(row for row in rows_of(name) if row.items() >= wanted.items())


def printed_by(command: str) -> list[str]:
    """Returns the lines that a command of benchmarks.pages.first_run printed."""
    return [row["line"] for row in rows_of("first_run") if row["command"] == command]


def summary(regrets: list[float]) -> str:
    """Returns mean and worst regret, from 10 runs on with the interval of the mean."""
    uncertainty = f" ({interval(regrets)})" if len(regrets) >= 10 else ""
    return f"mean {sum(regrets) / len(regrets):.1f}{uncertainty}, worst {max(regrets):.1f}"


def fenced(lines: list[str]) -> str:
    """Returns lines as a block of code."""
    return "\n".join(["```text", *lines, "```"]) + "\n"


def presets() -> str:
    """Returns the list of the presets with their tasks."""
    return markdown(
        [
            {
                "preset": f"`{name}`",
                "task": config.task.name,
                "what it is": DESCRIPTIONS[name],
            }
            for name, config in PRESETS.items()
        ]
    )


def settings() -> str:
    """Returns the list of all settings with the values of `reference`."""
    default = kp.preset()
    return markdown(
        [
            {
                "setting": f"`{field.name}`",
                "`reference`": format_value(getattr(default, field.name)),
                "meaning": field.metadata["help"],
            }
            for field in fields(kp.Config)
        ]
    )


def departure_table(preset: str) -> str:
    """Returns a preset's departures from the earlier one with reasons and measured regrets."""
    earlier, later = kp.preset(BEFORE[preset]), kp.preset(preset)
    regrets = measured(preset)
    rows = []
    for name in departures(preset):
        if name not in REASONS[preset]:
            raise SystemExit(
                f"error: benchmarks/pages/reasons.py: {preset} has no reason for {name}"
            )
        if name not in regrets:
            raise SystemExit(
                f"error: benchmarks/results/departures_{preset}.json has no row {name}: run "
                f"`python -m benchmarks.learning.departures {preset}`"
            )
        rows.append(
            {
                "setting": f"`{name}`",
                earlier.preset: format_value(getattr(earlier, name)),
                preset: format_value(getattr(later, name)),
                "why": REASONS[preset][name],
                "regret without it": summary(regrets[name]),
            }
        )
    regret_lines = "".join(
        f"- `{name}`: {summary(regrets[name])}\n" for name in (preset, earlier.preset)
    )
    return f"The regrets of both presets:\n\n{regret_lines}\n{markdown(rows)}"


def choosing() -> str:
    """Returns the settings beside `reference`, on seeds that no other result is reported for."""
    rows = rows_of("choosing")
    expected = [arm.partition(":")[0] for arm in ARMS]
    assert [row["training"] for row in rows] == expected, (
        "run benchmarks.learning.rejected_settings again"
    )
    return markdown(
        [{"settings": row["training"], "regret": summary(row["regrets"])} for row in rows]
    )
