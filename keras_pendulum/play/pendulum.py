"""The pendulum in the game."""

from __future__ import annotations

import itertools
import math
from typing import Any, ClassVar

import numpy as np
import pygame

from keras_pendulum.environments.pendulum import MAX_SPEED, Pendulum
from keras_pendulum.environments.torque import MAX_TORQUE, require_torque
from keras_pendulum.figures.style import rgb, torque_color
from keras_pendulum.play.drawing import INK, PAPER, ROD, WHITE
from keras_pendulum.play.played_task import Observation, PlayedTask


class PlayedPendulum(PlayedTask):
    """A key sets the torque to -2, 0 or 2 N·m."""

    task: Pendulum
    effort: ClassVar[str] = "torque"
    unit: ClassVar[str] = "N·m"
    largest_effort: ClassVar[float] = MAX_TORQUE
    rightward: ClassVar[int] = -1
    directions: ClassVar[tuple[str, str]] = ("clockwise", "counterclockwise")
    keys: ClassVar[str] = "l or Left: +2 N·m      k or Down: 0      j or Right: -2 N·m"
    return_digits: ClassVar[int] = 1
    angles: ClassVar[dict[float, str]] = {-math.pi: "-180°", 0: "0° (upright)", math.pi: "180°"}
    speeds: ClassVar[tuple[float, ...]] = (-MAX_SPEED, -4, 0, 4, MAX_SPEED)

    @property
    def setting(self) -> str:
        """The gravity."""
        return f"g = {self.task.gravity:g} m/s²"

    def effort_of(self, direction: int, step: int) -> float:
        """Returns the torque in N·m."""
        return MAX_TORQUE * direction

    def action(self, effort: float) -> Any:
        """Returns the torque as an array [1]. Raises ValueError for one outside of ±2 N·m."""
        # The environment would clip a larger torque, and its state would stay NaN after a NaN.
        require_torque(effort)
        return np.array([effort])

    def effort_of_action(self, action: Any) -> float:
        """Returns the torque in N·m."""
        return self.task.torque_of(action)

    def state(self, observation: Observation) -> tuple[float, float]:
        """Returns θ, -π to π, and θ̇."""
        cosine, sine, speed = map(float, observation)
        return math.atan2(sine, cosine), speed

    def draw(
        self, observation: Observation, effort: float, size: tuple[int, int]
    ) -> pygame.Surface:
        """Returns a picture of the pendulum, with its torque as an arrow around the pivot."""
        return draw_pendulum(self.state(observation)[0], effort, size)


def draw_pendulum(angle: float, torque: float, size: tuple[int, int]) -> pygame.Surface:
    """Returns a picture of the pendulum and of its torque, an arrow around the pivot.

    Args:
        angle: θ in rad, counterclockwise from upright.
        torque: N·m, of the last step.
        size: of the picture, in pixels.
    """
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
    if torque:
        _draw_arrow(picture, middle, 0.2 * height, torque)
    return pygame.transform.smoothscale(picture, size)


def _draw_arrow(
    picture: pygame.Surface, middle: pygame.Vector2, radius: float, torque: float
) -> None:
    """Draws an arc from below the pivot, as long as the torque is large.

    Its white border separates it from the rod, which is as dark.
    """
    color, direction = rgb(torque_color(torque)), math.copysign(1, torque)
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
