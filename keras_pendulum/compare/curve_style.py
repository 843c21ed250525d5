"""Colours, lines and markers of the curves of a figure."""

from __future__ import annotations

from typing import Any

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


def curve_style(index: int) -> CurveStyle:
    """Returns the style of the curve `index`; a repeated colour has another line and marker."""
    color, _, _ = STYLES[index % len(STYLES)]
    # With a shift of three, a repeated colour gets a line that looks different from its first one.
    _, line, marker = STYLES[(index + index // len(STYLES) * 3) % len(STYLES)]
    return color, line, marker
