"""The table of compared runs."""

from __future__ import annotations

from collections.abc import Sequence

from keras_pendulum.compare.runs import ComparedRun
from keras_pendulum.errors import one_line

_HEADER = ("run", "preset", "seed", "episodes", "updates", "mean return", "regret", "changes")
_NUMBERS = ("seed", "episodes", "updates", "mean return", "regret")  # aligned on the right


def as_markdown(runs: Sequence[ComparedRun]) -> str:
    """Returns a table with a row for each run, in aligned columns."""
    columns = []
    for name, *cells in zip(_HEADER, *map(_cells, runs), strict=True):
        width = max(map(len, (name, *cells)))
        if name in _NUMBERS:
            columns.append([name.rjust(width), "-" * (width - 1) + ":"])
            columns[-1] += [cell.rjust(width) for cell in cells]
        else:
            columns.append([name.ljust(width), "-" * width, *(cell.ljust(width) for cell in cells)])
    return "\n".join(f"| {' | '.join(row)} |" for row in zip(*columns, strict=True))


def _cells(run: ComparedRun) -> tuple[str, ...]:
    done, wanted = len(run.history), run.config.episodes
    return tuple(
        one_line(cell).replace("|", "/")
        for cell in (
            run.name,
            run.config.preset,
            str(run.config.seed),
            str(done) if done >= wanted else f"{done} of {wanted}",
            str(run.history[-1].updates),
            f"{run.score.mean_return:.2f}",
            f"{run.score.regret:.2f}",
            run.changed_settings or "–",
        )
    )
