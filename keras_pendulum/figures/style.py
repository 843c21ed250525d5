"""The style of all pictures: their fonts, the colours of torques, names, and the PNG file.

The colours of torques are the same in every picture and on the page. They are distinct for
colour-blind people. In black and white the two directions look alike, so each picture also tells
them apart in another way: by place, sign or hatching.
"""

from __future__ import annotations

import contextlib
import io
import textwrap
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Matplotlib's settings. The texts are legible at half the size too.
_STYLE: Any = {"font.size": 12, "axes.titlesize": "medium", "hatch.linewidth": 0.6}
CLOCKWISE = "#1c66ad"  # below 0 N·m
NO_TORQUE = "#f4f2ec"
COUNTERCLOCKWISE = "#d4620a"  # above 0 N·m
SCALE = (CLOCKWISE, NO_TORQUE, COUNTERCLOCKWISE)  # from -2 to 2 N·m


@contextlib.contextmanager
def own_style(font_size: float = 12) -> Iterator[None]:
    """Draws with Matplotlib's defaults and the style above, not the user's."""
    import matplotlib

    with matplotlib.rc_context():
        matplotlib.rcdefaults()  # it keeps the backend
        matplotlib.rcParams.update({**_STYLE, "font.size": font_size})
        yield


def torque_color(torque: float) -> tuple[int, int, int]:
    """Returns the colour of the direction of a torque, as `rgb` does."""
    return rgb(CLOCKWISE if torque < 0 else COUNTERCLOCKWISE)


def rgb(color: str) -> tuple[int, int, int]:
    """Returns red, green and blue, 0 to 255, of a colour such as `#1c66ad`."""
    red, green, blue = bytes.fromhex(color[1:])
    return red, green, blue


def plain_text(text: str, letters: int) -> str:
    """Returns a text for Matplotlib to draw letter by letter, in lines of so many letters."""
    # A dollar sign would start a formula.
    return textwrap.fill(text, letters).replace("$", r"\$")


def png(figure: Figure, dpi: int = 100) -> bytes:
    """Returns the figure as a PNG file. Call it in `own_style`, as Matplotlib draws it only now."""
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=dpi)
    return stream.getvalue()
