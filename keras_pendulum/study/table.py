"""The table of a study as Markdown, CSV and JSON."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from keras_pendulum.optimum.solutions import solution
from keras_pendulum.study.arms import Arm
from keras_pendulum.study.job import EVALUATION_EPISODES, RunResult
from keras_pendulum.study.statistics import Interval, interquartile_mean, probability_of_improvement


@dataclass(frozen=True)
class Row:
    """The numbers of an arm with at least one run."""

    arm: Arm
    regrets: list[float]  # by seed
    regret: Interval  # interquartile mean
    discount_regret: float | None  # of the exact policy for the arm's discount; None for CartPole
    better: Interval | None  # probability that a run has less regret than one of the baseline

    def as_json(self) -> dict[str, Any]:
        """Returns the row by table.csv's column names; None for an unknown number."""
        better = self.better or (None, None, None)
        values = {
            "arm": self.arm.name,
            "task": self.arm.task,
            "runs": len(self.regrets),
            "regret_iqm": self.regret.value,
            "regret_low": self.regret.low,
            "regret_high": self.regret.high,
            "regret_mean": sum(self.regrets) / len(self.regrets),
            "regret_worst": max(self.regrets),
            "discount_regret": self.discount_regret,
            **dict(zip(("better_probability", "better_low", "better_high"), better, strict=True)),
            "compared_with": self.arm.baseline if self.better else None,
        }
        # Only NaN differs from itself.
        return {name: value if value == value else None for name, value in values.items()}


def make_rows(arms: Sequence[Arm], results: Mapping[str, Sequence[RunResult]]) -> list[Row]:
    """Returns a row for each arm with runs, in the order of the arms."""
    regrets = {name: [result.regret for result in runs] for name, runs in results.items()}
    rows = []
    for arm in arms:
        own, baseline = regrets[arm.name], regrets.get(arm.baseline or "", [])
        if own:
            better = probability_of_improvement(own, baseline) if baseline else None
            starts = range(EVALUATION_EPISODES)
            cost = solution(arm.config.task).discount_cost(arm.config.discount, starts)
            rows.append(Row(arm, own, interquartile_mean(own), cost, better))
    return rows


def as_markdown(rows: Sequence[Row]) -> str:
    """Returns the table for people."""
    lines = [
        "| arm | task | runs | regret | 95 % interval | mean | worst | better than … in "
        "| discount alone |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in rows:
        numbers = row.as_json()
        cells = [
            row.arm.name,
            row.arm.task,
            str(numbers["runs"]),
            _number(row.regret.value),
            _range(row.regret, _number),
            _number(numbers["regret_mean"]),
            _number(numbers["regret_worst"]),
            "–",
            "–" if row.discount_regret is None else _number(row.discount_regret),
        ]
        if row.better:
            share = f"{row.better.value:.0%} ({_range(row.better, '{:.0%}'.format)})"
            cells[-2] = f"{row.arm.baseline}: {share}"
        lines.append(f"| {' | '.join(cell.replace('|', '/') for cell in cells)} |")
    return (
        "\n".join(lines)
        + "\n\nRegret: the best possible mean return on 100 fixed starts minus the greedy mean "
        "return; its interquartile mean over the runs, with a 95 % bootstrap interval. "
        "Better than: the share of pairs of runs in which this arm's run has less regret than the "
        "named arm's. Discount alone: the regret of the exact policy for the arm's discount.\n"
    )


def as_csv(rows: Sequence[Row]) -> str:
    """Returns the table for spreadsheets; unknown numbers are empty."""
    lines = [row.as_json() for row in rows]
    text = io.StringIO()
    writer = csv.DictWriter(text, list(lines[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(lines)
    return text.getvalue()


def as_json(rows: Sequence[Row], versions: Mapping[str, str]) -> str:
    """Returns the table for programs, with the regret of each run."""
    lines = [{**row.as_json(), "regrets": row.regrets} for row in rows]
    content = {"versions": dict(versions), "rows": lines}
    return json.dumps(content, indent=2, ensure_ascii=False) + "\n"


def _number(value: float) -> str:
    return f"{value:.2f}" if abs(value) < 10 else f"{value:.1f}"


def _range(interval: Interval, show: Any) -> str:
    if math.isnan(interval.low):
        return "one run"
    return f"{show(interval.low)} to {show(interval.high)}"
