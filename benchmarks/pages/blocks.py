"""The blocks of figures in README.md and docs/*.md, by name."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from benchmarks.learning.departures import BEFORE
from benchmarks.pages import code_blocks, paper_blocks, preset_blocks, study_blocks
from benchmarks.result_files import ROOT, markdown, rows_of

BLOCKS: dict[str, Callable[[], str]] = {
    "story": preset_blocks.story,
    "first run": preset_blocks.first_run,
    "score": preset_blocks.score,
    "diagnosis": preset_blocks.diagnosis,
    "comparison": preset_blocks.comparison,
    "presets": preset_blocks.presets,
    "settings": preset_blocks.settings,
    "quality": preset_blocks.quality,
    **{f"departures of {name}": partial(preset_blocks.departure_table, name) for name in BEFORE},
    "choosing": preset_blocks.choosing,
    "Mnih et al. 2015": paper_blocks.mnih_table,
    "steps": study_blocks.steps,
    "study": study_blocks.study_table,
    "exercise 1": study_blocks.exercise_updates,
    "exercise 2": study_blocks.exercise_indices,
    "cost of a study": study_blocks.study_cost,
    "limits of a study": study_blocks.study_scale,
    "last regret": lambda: markdown(rows_of(code_blocks.LAST_REGRET)),
    "last regret of swingup": lambda: markdown(rows_of("last_regret_swingup")),
    "shares of the last regret": code_blocks.last_regret_shares,
    "benchmarks": code_blocks.benchmarks,
    "installation": lambda: markdown(rows_of("installation")),
    "recorded runs": code_blocks.recorded_runs,
    "recorded run of CartPole": lambda: markdown(rows_of("recorded_cartpole")),
    "learning of CartPole": lambda: markdown(rows_of("cartpole_learning")),
    "falls of CartPole": lambda: markdown(rows_of("cartpole_falls")),
    "speed of CartPole": code_blocks.cartpole_speed,
    "speeds": code_blocks.speeds,
    "example programs": lambda: markdown(rows_of("example_programs")),
    "training curves": lambda: markdown(rows_of("training_curves")),
    "finer torques": code_blocks.finer_torques,
    "tests of the files": code_blocks.file_tests,
    "files of the DQN": code_blocks.dqn_files,
    "measured diagnosis": lambda: markdown(rows_of("diagnosis")),
    "strangers": lambda: markdown(rows_of("diagnosis_strangers")),
    "strangers of CartPole": lambda: markdown(rows_of("diagnosis_cartpole")),
    "healthy networks": lambda: markdown(rows_of("diagnosis_healthy")),
    "two faults": lambda: markdown(rows_of("diagnosis_pairs")),
}


def documents() -> Iterator[Path]:
    """Yields README.md and the pages of docs."""
    yield ROOT / "README.md"
    yield from sorted((ROOT / "docs").glob("*.md"))
