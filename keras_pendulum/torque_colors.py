"""The colours of torques, the same in every picture and on the page.

They are distinct for colour-blind people. In black and white the two directions look alike, so
each picture also tells them apart in another way: by place, sign or hatching.
"""

from __future__ import annotations

CLOCKWISE = "#1c66ad"  # below 0 N·m
NO_TORQUE = "#f4f2ec"
COUNTERCLOCKWISE = "#d4620a"  # above 0 N·m
SCALE = (CLOCKWISE, NO_TORQUE, COUNTERCLOCKWISE)  # from -2 to 2 N·m


def torque_color(torque: float) -> str:
    """Returns the colour of the direction of a torque."""
    return CLOCKWISE if torque < 0 else COUNTERCLOCKWISE


def rgb(color: str) -> tuple[int, int, int]:
    """Returns red, green and blue, 0 to 255, of a colour such as `#1c66ad`."""
    red, green, blue = bytes.fromhex(color[1:])
    return red, green, blue
