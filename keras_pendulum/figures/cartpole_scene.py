"""The drawing of CartPole."""

from __future__ import annotations

import math
from typing import ClassVar

import pygame

from keras_pendulum.figures.drawing import INK, LINE, PAPER, ROD, WHITE
from keras_pendulum.figures.scene import Observation, Scene
from keras_pendulum.figures.style import torque_color
from keras_pendulum.optimum.cartpole_dynamics import LARGEST_ANGLE, LARGEST_POSITION

_POLE = 1.0  # m, its length


class CartPoleScene(Scene):
    """The cart on its track, with the push as an arrow."""

    directions: ClassVar[tuple[str, str]] = ("left", "right")
    return_digits: ClassVar[int] = 0
    angles: ClassVar[dict[float, str]] = {-LARGEST_ANGLE: "−12°", 0: "0°", LARGEST_ANGLE: "12°"}

    def draw(
        self, observation: Observation, effort: float, size: tuple[int, int]
    ) -> pygame.Surface:
        """Returns a picture of the cart on its track, with the push as an arrow."""
        position, angle = float(observation[0]), float(observation[2])
        picture = pygame.Surface((2 * size[0], 2 * size[1]))
        picture.fill(WHITE)
        meter = 0.9 * picture.get_width() / (2 * LARGEST_POSITION)
        middle, track = picture.get_width() / 2, 0.72 * picture.get_height()
        _draw_track(picture, middle, track, meter)
        cart = pygame.Vector2(middle + position * meter, track - 0.16 * meter)
        for limit in (-LARGEST_ANGLE, LARGEST_ANGLE):
            pygame.draw.line(picture, PAPER, cart, _tip(cart, limit, 1.1 * _POLE * meter), width=4)
        box = pygame.Rect(0, 0, round(0.5 * meter), round(0.3 * meter))
        box.center = round(cart.x), round(cart.y)
        pygame.draw.rect(picture, INK, box, border_radius=8)
        tip, thick = _tip(cart, angle, _POLE * meter), 0.05 * meter
        side = thick * pygame.Vector2(math.cos(angle), math.sin(angle))
        pygame.draw.polygon(picture, ROD, [cart + side, tip + side, tip - side, cart - side])
        for place in (cart, tip):
            pygame.draw.circle(picture, ROD, place, thick)
        if effort:
            _draw_push(picture, box, effort, meter)
        return pygame.transform.smoothscale(picture, size)


def _tip(cart: pygame.Vector2, angle: float, length: float) -> pygame.Vector2:
    return cart + length * pygame.Vector2(math.sin(angle), -math.cos(angle))


def _draw_track(picture: pygame.Surface, middle: float, track: float, meter: float) -> None:
    """Draws the track, with a post at each end that terminates an episode."""
    left, right = (middle + end * LARGEST_POSITION * meter for end in (-1, 1))
    pygame.draw.line(picture, LINE, (left, track), (right, track), width=6)
    pygame.draw.line(picture, PAPER, (middle, track), (middle, track + 0.1 * meter), width=6)
    for end in (left, right):
        top, bottom = track - 0.35 * meter, track + 0.1 * meter
        pygame.draw.line(picture, LINE, (end, top), (end, bottom), width=6)


def _draw_push(picture: pygame.Surface, box: pygame.Rect, force: float, meter: float) -> None:
    """Draws an arrow below the cart, in the direction of the push."""
    color, direction = torque_color(force), math.copysign(1, force)
    height = box.bottom + 0.3 * meter
    tail, head = (box.centerx + direction * each * meter for each in (-0.3, 0.2))
    pygame.draw.line(picture, color, (tail, height), (head, height), width=round(0.08 * meter))
    corners = [(head, height - 0.12 * meter), (head, height + 0.12 * meter)]
    pygame.draw.polygon(picture, color, [*corners, (head + direction * 0.2 * meter, height)])
