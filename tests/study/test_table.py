"""The table of a study, compared with numbers computed by hand."""

from __future__ import annotations

import csv
import io
import json
from typing import Any

import pytest

from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.optimum.pendulum import PendulumSolution
from keras_pendulum.optimum.solutions import optimal_return
from keras_pendulum.study.arms import own_arms
from keras_pendulum.study.job import RunResult
from keras_pendulum.study.table import as_csv, as_json, as_markdown, make_rows


def test_columns_have_the_numbers_of_their_names() -> None:
    results = {
        "reference": [RunResult(-1.0, [-5.0, -7.0], [], [], [])] * 4,  # regret 5
        "other": [RunResult(0.0, [-regret], [], [], []) for regret in (20.0, 3.0, 1.0, 4.0)],
    }
    rows = make_rows(own_arms(["reference"], ["other: reference"]), results)
    assert [row.regrets for row in rows] == [[5.0] * 4, [20.0, 3.0, 1.0, 4.0]]
    rows_json = json.loads(as_json(rows, {}))["rows"]
    expected: list[dict[str, Any]] = [
        {"regret_iqm": 5.0, "regret_mean": 5.0, "regret_worst": 5.0, "better_probability": None},
        # The interquartile mean leaves out 1 and 20; three of four beat 5.
        {"regret_iqm": 3.5, "regret_mean": 7.0, "regret_worst": 20.0, "better_probability": 0.75},
    ]
    assert [{name: row[name] for name in expected[0]} for row in rows_json] == expected
    table = list(csv.DictReader(io.StringIO(as_csv(rows))))
    assert [float(table[1][name]) for name in expected[1]] == pytest.approx([3.5, 7, 20, 0.75])
    cells = as_markdown(rows).splitlines()[3].split(" | ")
    assert [cells[place] for place in (2, 3, 5, 6)] == ["4", "3.50", "7.00", "20.0"]
    assert cells[7].startswith("reference: 75% (")


def test_table_has_the_regret_that_the_discount_alone_costs() -> None:
    arms = own_arms(["reference", "cartpole"], ["exact: reference discount=1"])
    rows = make_rows(arms, {arm.name: [RunResult(0.0, [-9.0], [], [], [])] for arm in arms})
    costs = [row["discount_regret"] for row in json.loads(as_json(rows, {}))["rows"]]
    gamma = arms[0].config.discount
    returns = PendulumSolution(Pendulum()).discounted_returns(gamma, range(100))
    assert costs == [pytest.approx((optimal_return(1.0, range(100)) - returns).mean()), 0.0, 0.0]
    cells = [line.rstrip("| ").split(" | ")[8] for line in as_markdown(rows).splitlines()[2:5]]
    assert cells == [f"{costs[0]:.2f}", "0.00", "0.00"]
