"""A step of an episode as the game and films show it: scene, phase portrait and numbers."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import pygame

from keras_pendulum.figures.drawing import INK, LARGE, LINE, PALE_INK, PAPER, ROD, WHITE
from keras_pendulum.figures.scene import Observation, Scene
from keras_pendulum.figures.style import rgb, torque_color

BELOW = 96  # pixels below the pictures, for the effort and the numbers
States = Sequence[tuple[float, float]]  # θ (rad) and θ̇ (rad/s)
Write = Callable[..., None]  # `Writer.write`

_PATH, _EARLIER = (25, 25, 25), (150, 150, 150)
_FINE = 2  # pixels of a drawing for each on the screen, for smooth edges


@dataclass(frozen=True)
class Moment:
    """The state and the numbers of a step."""

    observation: Observation  # [D]
    effort: float  # of the last step
    step: int
    steps: int  # of a whole episode
    reward: float  # of the last step
    total_reward: float  # the return so far
    optimal_return: float  # of a whole episode
    path: States  # so far; the last state is present
    earlier_path: States = ()  # of another episode


def draw_moment(
    screen: pygame.Surface, write: Write, place: pygame.Rect, scene: Scene, moment: Moment
) -> None:
    """Draws the scene, the phase portrait beside it, and the numbers below.

    Args:
        screen: to draw on.
        write: of a `Writer` for the same surface.
        place: the rectangle to fill.
        scene: of the task.
        moment: to show.
    """
    left = pygame.Rect(place.left, place.top, place.width // 2, place.height - BELOW)
    screen.blit(scene.draw(moment.observation, moment.effort, left.size), left)
    right = left.move(left.width, 0)
    pygame.draw.rect(screen, WHITE, right)
    draw_portrait(screen, write, right, scene, moment.path, moment.earlier_path)
    # A strip along the lower edge shows the elapsed share of the episode.
    width = place.width * moment.step // moment.steps
    pygame.draw.rect(screen, LINE, (place.left, left.bottom - 4, width, 4))
    bar = pygame.Rect(0, left.bottom + 16, round(0.56 * left.width), 18)
    bar.centerx = left.centerx
    _draw_effort(screen, write, bar, scene, moment.effort)
    numbers = {
        scene.effort: f"{_signed(moment.effort)} {scene.unit}",
        "step": f"{moment.step} of {moment.steps}",
        "reward": f"{moment.reward:z.3f}",
        "return": scene.show_return(moment.total_reward),
        "best possible": scene.show_return(moment.optimal_return),
    }
    column = place.width / len(numbers)
    for i, (name, text) in enumerate(numbers.items()):
        middle = place.left + round((i + 0.5) * column)
        write(name, (middle, bar.bottom + 16), align=0.5, color=PALE_INK)
        write(text.replace("-", "−"), (middle, bar.bottom + 35), LARGE, align=0.5)


def _signed(effort: float) -> str:
    return f"{effort:+.1f}" if abs(effort) >= 0.05 else "0.0"


def _draw_effort(
    screen: pygame.Surface, write: Write, bar: pygame.Rect, scene: Scene, effort: float
) -> None:
    """Draws a bar from the middle; a positive effort points to the right."""
    pygame.draw.rect(screen, WHITE, bar)
    length = round(min(1.0, abs(effort) / scene.largest_effort) * bar.width / 2)
    left = bar.centerx - (length if effort < 0 else 0)
    pygame.draw.rect(screen, rgb(torque_color(effort)), (left, bar.top, length, bar.height))
    pygame.draw.rect(screen, LINE, bar, width=1)
    pygame.draw.line(screen, INK, bar.midtop, bar.midbottom, width=2)
    negative, positive = scene.directions
    write(negative, (bar.left - 10, bar.top), align=1.0)
    write(positive, (bar.right + 10, bar.top))


def draw_portrait(
    screen: pygame.Surface,
    write: Write,
    place: pygame.Rect,
    scene: Scene,
    path: States,
    earlier: States,
) -> None:
    """Draws the phase portrait: speed over angle, with the path of the episode.

    Args:
        screen: to draw on.
        write: of a `Writer` for the same surface.
        place: the rectangle for the portrait and its labels.
        scene: has the limits of the axes.
        path: of the episode so far, dark; its last state is a dot.
        earlier: of another episode, pale.
    """
    frame = pygame.Rect(place.left + 66, place.top + 30, place.width - 90, place.height - 96)
    largest = max(scene.angles), max(scene.speeds)

    def pixel(state: tuple[float, float]) -> pygame.Vector2:
        x, y = (value / end for value, end in zip(state, largest, strict=True))
        x *= scene.rightward  # what leans to the right is on the right
        return pygame.Vector2((1 + x) * frame.width / 2, (1 - y) * frame.height / 2)

    plane = pygame.Surface((_FINE * frame.width, _FINE * frame.height))
    plane.fill(WHITE)
    for angle, name in scene.angles.items():
        x = pixel((angle, 0.0)).x
        pygame.draw.line(plane, PAPER, (_FINE * x, 0), (_FINE * x, plane.get_height()), 2 * _FINE)
        write(name, (frame.left + round(x), frame.bottom + 6), align=0.5, color=PALE_INK)
    for speed in scene.speeds:
        y = pixel((0.0, speed)).y
        pygame.draw.line(plane, PAPER, (0, _FINE * y), (plane.get_width(), _FINE * y), 2 * _FINE)
        label = (frame.left - 8, frame.top + round(y) - 8)
        write(f"{speed:g}".replace("-", "−"), label, align=1.0, color=PALE_INK)
    write("speed (rad/s) over angle", (frame.centerx, place.top + 8), align=0.5)
    for states, color, width in ((earlier, _EARLIER, 4), (path, _PATH, 2)):
        for before, after in itertools.pairwise(states):
            # No line crosses the portrait where the angle jumps from one edge to the other.
            if abs(before[0] - after[0]) < largest[0]:
                ends = _FINE * pixel(before), _FINE * pixel(after)
                pygame.draw.line(plane, color, *ends, _FINE * width)
    dot = pixel(path[-1])
    dot.x = min(max(dot.x, 0), frame.width)  # a state after a fall is outside
    dot.y = min(max(dot.y, 0), frame.height)
    for color, radius in ((WHITE, 8), (ROD, 6)):
        pygame.draw.circle(plane, color, _FINE * dot, _FINE * radius)
    screen.blit(pygame.transform.smoothscale(plane, frame.size), frame)
    pygame.draw.rect(screen, LINE, frame, width=1)
    if earlier:
        write("pale: your path", (frame.left, frame.bottom + 28), color=PALE_INK)
