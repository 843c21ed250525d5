"""Curves of several runs in one panel: their colours, lines and markers, and their legend."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import count
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from keras_pendulum.config.presets import PRESETS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CurveStyle = tuple[str, Any, str]  # colour, line, marker
# The colours of Okabe and Ito, with brown for their yellow, which is faint on white. Each has its
# own line and marker, so that the curves can be distinguished without colour.
STYLES: tuple[CurveStyle, ...] = (
    ("black", "-", "s"),
    ("#0072B2", "-", "o"),
    ("#D55E00", "--", "^"),
    ("#009E73", "-.", "v"),
    ("#CC79A7", ":", "D"),
    ("#E69F00", (0, (5, 1, 1, 1, 1, 1)), "P"),
    ("#56B4E9", (0, (1, 1)), "X"),
    ("#8C510A", (0, (8, 2)), "*"),
)
# The index of the style of each preset, the same everywhere; 0, black, is the optimum.
PRESET_STYLES = {name: index for index, name in enumerate(PRESETS, 1)}
_MARKERS = 8  # on each curve


def curve_style(index: int) -> CurveStyle:
    """Returns the style of the curve `index`; a repeated colour has another line and marker."""
    color, _, _ = STYLES[index % len(STYLES)]
    # With a shift of three, a repeated colour gets a line that looks different from its first one.
    _, line, marker = STYLES[(index + index // len(STYLES) * 3) % len(STYLES)]
    return color, line, marker


def curve_styles(names: Sequence[str | None]) -> list[CurveStyle]:
    """Returns the style of each curve. The first one of a preset has that of the preset."""
    taken = {PRESET_STYLES.get(name or "", 0) for name in names}
    others = (index for index in count(1) if index not in taken)
    seen: set[str | None] = set()
    styles = []
    for name in names:
        own = None if name in seen else PRESET_STYLES.get(name or "")
        styles.append(curve_style(next(others) if own is None else own))
        seen.add(name)
    return styles


def draw_marked_curve(
    axes: Axes, x: ArrayLike, y: NDArray[np.float64], style: CurveStyle, place: float, label: str
) -> None:
    """Draws one of several curves.

    Args:
        axes: to draw on.
        x: [N].
        y: [N].
        style: of the curve.
        place: of the first marker, as a share of the distance between two. Each curve has its own
            place, so that the markers do not cover each other.
        label: for the legend.
    """
    color, line, marker = style
    between = max(1, len(y) // _MARKERS)
    axes.plot(
        x,
        y,
        color=color,
        linestyle=line,
        linewidth=1.8,
        marker=marker,
        markevery=(int(between * place), between),
        label=label,
    )


def draw_legend_below(figure: Figure, panels: Iterable[Axes], columns: int) -> None:
    """Names the curves below the panels, where the legend covers no curve; each name once."""
    lines = {str(line.get_label()): line for axes in panels for line in axes.lines}
    figure.legend(
        list(lines.values()),
        list(lines),
        loc="outside lower center",
        ncols=columns,
        frameon=False,
        handlelength=4,
    )
