"""The texts that the game and films draw: whether they are legible."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pygame
import pytest

from keras_pendulum.figures.drawing import INK, SMALL, Writer


def record_texts(monkeypatch: pytest.MonkeyPatch) -> list[pygame.Rect]:
    """Returns a list that gets the place of each text drawn from now on."""
    boxes: list[pygame.Rect] = []
    write = Writer.write

    def record(
        self: Writer, text: str, place: tuple[int, int], *options: Any, **named: Any
    ) -> None:
        write(self, text, place, *options, **named)
        drawn = self._render(text, (*options, SMALL)[0], named.get("color", INK))
        left = place[0] - round(named.get("align", 0.0) * drawn.get_width())
        boxes.append(drawn.get_rect(topleft=(left, place[1])))

    monkeypatch.setattr(Writer, "write", record)
    return boxes


def require_legible_texts(boxes: Sequence[pygame.Rect], size: tuple[int, int]) -> None:
    """Fails where a text overlaps another or leaves a picture of this size in pixels."""
    for i, box in enumerate(boxes):
        assert pygame.Rect((0, 0), size).contains(box), box
        # Each line has some empty pixels above and below its letters.
        assert box.inflate(0, -6).collidelist([b.inflate(0, -6) for b in boxes[:i]]) == -1
