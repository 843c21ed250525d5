"""A study's table, for people, spreadsheets and programs."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from keras_pendulum.arms import Arm
from keras_pendulum.intervals import Interval, interquartile_mean, probability_of_improvement
from keras_pendulum.study_result import Result


@dataclass(frozen=True)
class Row:
    """What is known of an arm with at least one run."""

    arm: Arm
    regrets: list[float]  # by seed
    regret: Interval  # interquartile mean
    better: Interval | None  # probability that a run beats one of the arm it is compared with

    def as_json(self) -> dict[str, Any]:
        """The numbers under the names that table.csv has for its columns; None for unknown."""
        numbers = {
            "regret_iqm": self.regret.value,
            "regret_low": self.regret.low,
            "regret_high": self.regret.high,
            "regret_mean": sum(self.regrets) / len(self.regrets),
            "regret_worst": max(self.regrets),
        }
        better = self.better or Interval(math.nan, math.nan, math.nan)
        numbers |= dict(
            zip(("better_probability", "better_low", "better_high"), better, strict=True)
        )
        return {
            "arm": self.arm.name,
            "task": self.arm.task,
            "runs": len(self.regrets),
            **{name: None if math.isnan(value) else value for name, value in numbers.items()},
            "compared_with": self.arm.against if self.better else None,
        }


def make_rows(arms: Sequence[Arm], results: Mapping[str, Sequence[Result]]) -> list[Row]:
    """A row for each arm that has runs, in the arms' order."""
    regrets = {name: [result.regret for result in runs] for name, runs in results.items()}
    rows = []
    for arm in arms:
        ours, theirs = regrets[arm.name], regrets.get(arm.against or "", [])
        if ours:
            better = probability_of_improvement(ours, theirs) if theirs else None
            rows.append(Row(arm, ours, interquartile_mean(ours), better))
    return rows


def as_markdown(rows: Sequence[Row]) -> str:
    """The table for people."""
    lines = [
        "| arm | task | runs | regret | 95 % interval | mean | worst | better than … in |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in rows:
        told = row.as_json()
        cells = [
            row.arm.name,
            row.arm.task,
            str(told["runs"]),
            _number(row.regret.value),
            _range(row.regret, _number),
            _number(told["regret_mean"]),
            _number(told["regret_worst"]),
            "–",
        ]
        if row.better:
            share = f"{row.better.value:.0%} ({_range(row.better, '{:.0%}'.format)})"
            cells[-1] = f"{row.arm.against}: {share}"
        lines.append(f"| {' | '.join(cell.replace('|', '/') for cell in cells)} |")
    return (
        "\n".join(lines)
        + "\n\nRegret: the best possible mean return on 100 fixed starts minus the greedy one, its "
        "interquartile mean over the runs with a 95 % bootstrap interval. Last column: in how many "
        "pairs of runs this arm's has less regret than the named arm's.\n"
    )


def as_csv(rows: Sequence[Row]) -> str:
    """The table for spreadsheets; what is not known is empty."""
    told = [row.as_json() for row in rows]
    text = io.StringIO()
    writer = csv.DictWriter(text, list(told[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(told)
    return text.getvalue()


def as_json(rows: Sequence[Row], versions: Mapping[str, str]) -> str:
    """The table for programs, with each run's regret."""
    told = [{**row.as_json(), "regrets": row.regrets} for row in rows]
    content = {"versions": dict(versions), "rows": told}
    return json.dumps(content, indent=2, ensure_ascii=False) + "\n"


def _number(value: float) -> str:
    return f"{value:.2f}" if abs(value) < 10 else f"{value:.1f}"


def _range(interval: Interval, show: Any) -> str:
    if math.isnan(interval.low):
        return "one run"
    return f"{show(interval.low)} to {show(interval.high)}"
