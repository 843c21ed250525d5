"""The drawing of the pendulum."""

from __future__ import annotations

import itertools
import math
from typing import ClassVar

import pygame

from keras_pendulum.environments.torque import MAX_TORQUE
from keras_pendulum.figures.drawing import INK, PAPER, ROD, WHITE
from keras_pendulum.figures.scene import Observation, Scene
from keras_pendulum.figures.style import torque_color


class PendulumScene(Scene):
    """The pendulum, with its torque as an arrow around the pivot."""

    directions: ClassVar[tuple[str, str]] = ("clockwise", "counterclockwise")
    return_digits: ClassVar[int] = 1
    angles: ClassVar[dict[float, str]] = {-math.pi: "−180°", 0: "0° (upright)", math.pi: "180°"}

    def draw(
        self, observation: Observation, effort: float, size: tuple[int, int]
    ) -> pygame.Surface:
        """Returns a picture of the pendulum and of its torque."""
        angle, _ = self.state(observation)
        width, height = 2 * size[0], 2 * size[1]
        picture = pygame.Surface((width, height))
        picture.fill(WHITE)
        middle = pygame.Vector2(width / 2, height / 2)
        length, thick = 0.38 * height, 0.05 * height
        pygame.draw.circle(picture, PAPER, middle, length + thick, width=3)
        end = middle + length * pygame.Vector2(-math.sin(angle), -math.cos(angle))
        side = thick * pygame.Vector2(math.cos(angle), -math.sin(angle))
        pygame.draw.polygon(picture, ROD, [middle + side, end + side, end - side, middle - side])
        for place in (middle, end):
            pygame.draw.circle(picture, ROD, place, thick)
        pygame.draw.circle(picture, INK, middle, 0.4 * thick)
        if effort:
            _draw_arrow(picture, middle, 0.2 * height, effort)
        return pygame.transform.smoothscale(picture, size)


def _draw_arrow(
    picture: pygame.Surface, middle: pygame.Vector2, radius: float, torque: float
) -> None:
    """Draws an arc from below the pivot, as long as the torque is large.

    Its white border separates it from the rod, which is as dark.
    """
    color, direction = torque_color(torque), math.copysign(1, torque)
    sweep = 0.75 * math.pi * abs(torque) / MAX_TORQUE
    points = []
    for i in range(121):
        around = -direction * sweep / 2 + direction * sweep * i / 120  # from below
        points.append(middle + radius * pygame.Vector2(math.sin(around), math.cos(around)))
    outward = (points[-1] - middle) / radius
    ahead = pygame.Vector2(outward.y, -outward.x) * direction
    tip, base = points[-1] + 0.32 * radius * ahead, points[-1]
    corners = [tip, base + 0.17 * radius * outward, base - 0.17 * radius * outward]
    border = 0.05 * radius
    for one, other in itertools.pairwise([*corners, corners[0]]):
        pygame.draw.line(picture, WHITE, one, other, round(2 * border))
    for shade, extra in ((WHITE, border), (color, 0.0)):
        for point in points:
            pygame.draw.circle(picture, shade, point, radius / 16 + extra)
    pygame.draw.polygon(picture, color, corners)
