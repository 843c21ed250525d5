"""Films of episodes."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray


def encode_gif(
    frames: Sequence[NDArray[np.uint8]], seconds_per_frame: float, height: int = 250
) -> bytes:
    """Returns a looping GIF of RGB frames [H, W, 3], scaled to `height` pixels."""
    from PIL import Image

    size = (round(frames[0].shape[1] / frames[0].shape[0] * height), height)
    images: list[Any] = [Image.fromarray(frame).resize(size) for frame in frames]
    stream = io.BytesIO()
    images[0].save(
        stream,
        format="GIF",
        save_all=True,
        append_images=images[1:],
        duration=round(1000 * seconds_per_frame),
        loop=0,
    )
    return stream.getvalue()
