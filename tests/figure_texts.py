"""The texts of a Matplotlib figure: no two overlap, none leaves the figure, none is too small."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Callable, Iterator
from unittest import mock

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.text import Text
from matplotlib.transforms import Bbox

SMALLEST_FONT = 9  # points; at half the size and 100 pixels an inch a letter is 4 pixels high


def figure_of(draw: Callable[[], bytes]) -> Figure:
    """Returns the figure that `draw` saves as a PNG; each warning of Matplotlib is an error."""
    figures: list[Figure] = []

    def save(figure: Figure, *words: object, **named: object) -> None:
        figure.draw_without_rendering()
        figures.append(figure)

    with mock.patch.object(Figure, "savefig", save), warnings.catch_warnings():
        warnings.simplefilter("error")
        draw()
    (figure,) = figures
    return figure


def require_legible(figure: Figure) -> None:
    """Fails when a text overlaps another or another panel, leaves the figure, or is too small."""
    boxes = [(text, text.get_window_extent()) for text in shown_texts(figure)]
    for text, box in boxes:
        content = text.get_text()
        assert box.x0 >= 0 and box.y0 >= 0, f"{content!r} leaves the figure"
        assert box.x1 <= figure.bbox.x1 and box.y1 <= figure.bbox.y1, f"{content!r} leaves it"
        assert float(text.get_fontsize()) >= SMALLEST_FONT, f"{content!r} is too small"
        for axes in figure.axes:
            if text.axes is not axes:
                assert not _overlap(box, axes.bbox), f"{content!r} is on another panel"
    for legend in figure.findobj(Legend):
        box = legend.get_window_extent()
        assert box.x0 >= 0 and box.x1 <= figure.bbox.x1, "a legend leaves the figure"
        assert box.y0 >= 0 and box.y1 <= figure.bbox.y1, "a legend leaves the figure"
    for (one, first), (other, second) in itertools.combinations(boxes, 2):
        assert not _overlap(first, second), (one.get_text(), other.get_text())


def shown_texts(figure: Figure) -> Iterator[Text]:
    """Yields the texts that are drawn: Matplotlib keeps the labels of ticks outside the axes."""
    hidden = set()
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            shown = set(_shown_tick_labels(axes, axis))
            every = {
                label
                for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks())
                for label in (tick.label1, tick.label2)
            }
            hidden |= every - shown
    for text in figure.findobj(Text):
        assert isinstance(text, Text)
        if text not in hidden and text.get_visible() and text.get_text().strip():
            yield text


def _shown_tick_labels(axes: Axes, axis: Axis) -> Iterator[Text]:
    low, high = sorted(axis.get_view_interval())
    if not axes.axison:
        return
    for minor, places in ((False, axis.get_majorticklocs()), (True, axis.get_minorticklocs())):
        for place, label in zip(places, axis.get_ticklabels(minor=minor), strict=True):
            if low <= place <= high:
                yield label


def _overlap(one: Bbox, other: Bbox) -> bool:
    return one.padded(-1).overlaps(other.padded(-1))
