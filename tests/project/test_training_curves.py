"""The curves of docs/curves.md: what the benchmark logs of examples/my_dqn.py."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT

from benchmarks.learning.training_curves import (
    CURVES,
    HEALTHY,
    LOGGING,
    RUNS,
    draw,
    program,
    row,
    train,
)
from benchmarks.result_files import rows_of

PAGE = (ROOT / "docs" / "curves.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", RUNS)
def test_each_run_is_the_program_with_its_change(name: str, tmp_path: Path) -> None:
    program(RUNS[name], tmp_path)
    text = (tmp_path / "my_dqn.py").read_text(encoding="utf-8")
    assert RUNS[name][1] in text
    assert all(new in text for _, new in LOGGING)


def test_line_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"my_dqn.py has 0 times: no such line"):
        program(("no such line", ""), tmp_path)


def test_short_run_logs_every_curve_of_every_episode(tmp_path: Path) -> None:
    curves, regret = train(RUNS[HEALTHY], steps=1_600)
    assert curves.shape == (7, len(CURVES))  # the last of the 8 episodes is not logged
    returns, epsilon, loss, error, mean_q = curves.T
    assert (returns < 0).all()
    assert (np.diff(epsilon) <= 0).all()
    # The first updates are in the sixth episode.
    assert np.isnan(loss[:5]).all() and (loss[5:] > 0).all()
    # The mean of squares is at least the square of the mean, with the rewards times 0.02.
    assert (loss[5:] >= (0.02 * error[5:]) ** 2 * 0.999).all()
    assert np.isfinite(mean_q).all()
    assert row(HEALTHY, curves, regret)["regret"] == f"{regret:.0f}"
    draw(dict.fromkeys(RUNS, curves), tmp_path / "curves.png")
    assert (tmp_path / "curves.png").stat().st_size > 10_000


def test_stored_curves_are_as_the_page_says() -> None:
    rows = {
        each["run"]: {key: float(each[key]) for key in each if key != "run"}
        for each in rows_of("training_curves")
    }
    assert list(rows) == list(RUNS)
    healthy = rows[HEALTHY]
    assert all(
        each["regret"] > 5 * healthy["regret"] for name, each in rows.items() if name != HEALTHY
    )
    assert healthy["loss"] < rows["no target network"]["loss"]
    # Small, although the return is bad.
    assert rows["small replay buffer"]["TD error"] < 0.5 * rows["no target network"]["TD error"]
    assert rows["ε stays at 1"]["mean Q"] > 0 > healthy["mean Q"]
    assert abs(rows["few updates"]["mean Q"]) < 20


def test_page_shows_the_lines_that_log() -> None:
    assert LOGGING[0][1] in PAGE
    assert (ROOT / "docs" / "curves.png").stat().st_size < 200_000
