"""An episode as the game and films show it: scene, phase portrait and numbers of each step."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pygame

from keras_pendulum.figures.drawing import INK, LARGE, LINE, PALE_INK, PAPER, ROD, WHITE, Writer
from keras_pendulum.figures.scene import Observation, Scene
from keras_pendulum.figures.style import torque_color

if TYPE_CHECKING:
    import gymnasium

BELOW = 96  # pixels below the pictures, for the effort and the numbers
States = Sequence[tuple[float, float]]  # θ (rad) and θ̇ (rad/s)

_PATH, _EARLIER = (25, 25, 25), (150, 150, 150)
_FINE = 2  # pixels of a drawing for each on the screen, for smooth edges


@dataclass
class ShownEpisode:
    """An episode of a task, from an observation on."""

    scene: Scene
    env: gymnasium.Env[Any, Any]
    observation: Observation  # [D]
    optimal_return: float  # from the start on
    effort: float = 0.0  # of the last step: a torque in N·m, or a force in N
    steps: int = 0
    reward: float = 0.0  # of the last step
    total_reward: float = 0.0  # the undiscounted return so far
    done: bool = False

    def __post_init__(self) -> None:
        self.path = [self.scene.state(self.observation)]  # the last state is present

    def step(self, action: Any) -> None:
        """Takes one step with an action of the environment."""
        self.observation, reward, terminated, truncated, _ = self.env.step(action)
        self.effort, self.reward = self.scene.effort_of_action(action), float(reward)
        self.total_reward += self.reward
        self.steps += 1
        self.path.append(self.scene.state(self.observation))
        self.done = terminated or truncated


def draw_moment(
    writer: Writer, place: pygame.Rect, episode: ShownEpisode, earlier_path: States = ()
) -> None:
    """Draws the scene, the phase portrait beside it, and the numbers below.

    Args:
        writer: has the surface to draw on.
        place: the rectangle to fill.
        episode: after its last step.
        earlier_path: of another episode.
    """
    screen, scene = writer.screen, episode.scene
    left = pygame.Rect(place.left, place.top, place.width // 2, place.height - BELOW)
    screen.blit(scene.draw(episode.observation, episode.effort, left.size), left)
    right = left.move(left.width, 0)
    pygame.draw.rect(screen, WHITE, right)
    draw_portrait(writer, right, scene, episode.path, earlier_path)
    # A strip along the lower edge shows the elapsed share of the episode.
    all_steps = scene.task.steps_per_episode
    width = place.width * episode.steps // all_steps
    pygame.draw.rect(screen, LINE, (place.left, left.bottom - 4, width, 4))
    bar = pygame.Rect(0, left.bottom + 16, round(0.56 * left.width), 18)
    bar.centerx = left.centerx
    _draw_effort(writer, bar, scene, episode.effort)
    numbers = {
        scene.dynamics.effort: f"{_signed(episode.effort)} {scene.dynamics.unit}",
        "step": f"{episode.steps} of {all_steps}",
        "reward": f"{episode.reward:z.3f}",
        "return": scene.show_return(episode.total_reward),
        "best possible": scene.show_return(episode.optimal_return),
    }
    column = place.width / len(numbers)
    for i, (name, text) in enumerate(numbers.items()):
        middle = place.left + round((i + 0.5) * column)
        writer.write(name, (middle, bar.bottom + 16), align=0.5, color=PALE_INK)
        writer.write(text.replace("-", "−"), (middle, bar.bottom + 35), LARGE, align=0.5)


def _signed(effort: float) -> str:
    return f"{effort:+.1f}" if abs(effort) >= 0.05 else "0.0"


def _draw_effort(writer: Writer, bar: pygame.Rect, scene: Scene, effort: float) -> None:
    """Draws a bar from the middle; a positive effort points to the right."""
    screen = writer.screen
    pygame.draw.rect(screen, WHITE, bar)
    length = round(min(1.0, abs(effort) / scene.dynamics.largest_effort) * bar.width / 2)
    left = bar.centerx - (length if effort < 0 else 0)
    pygame.draw.rect(screen, torque_color(effort), (left, bar.top, length, bar.height))
    pygame.draw.rect(screen, LINE, bar, width=1)
    pygame.draw.line(screen, INK, bar.midtop, bar.midbottom, width=2)
    negative, positive = scene.directions
    writer.write(negative, (bar.left - 10, bar.top), align=1.0)
    writer.write(positive, (bar.right + 10, bar.top))


def draw_portrait(
    writer: Writer, place: pygame.Rect, scene: Scene, path: States, earlier: States
) -> None:
    """Draws the phase portrait: speed over angle, with the path of the episode.

    Args:
        writer: has the surface to draw on.
        place: the rectangle for the portrait and its labels.
        scene: has the dynamics, with the limits of the axes, and the labels.
        path: of the episode so far, dark; its last state is a dot.
        earlier: of another episode, pale.
    """
    screen, write = writer.screen, writer.write
    frame = pygame.Rect(place.left + 66, place.top + 30, place.width - 90, place.height - 96)
    largest = scene.dynamics.phase_ends

    def pixel(state: tuple[float, float]) -> pygame.Vector2:
        x, y = (value / end for value, end in zip(state, largest, strict=True))
        x *= scene.dynamics.rightward  # what leans to the right is on the right
        return pygame.Vector2((1 + x) * frame.width / 2, (1 - y) * frame.height / 2)

    plane = pygame.Surface((_FINE * frame.width, _FINE * frame.height))
    plane.fill(WHITE)
    for angle, name in scene.angles.items():
        x = pixel((angle, 0.0)).x
        pygame.draw.line(plane, PAPER, (_FINE * x, 0), (_FINE * x, plane.get_height()), 2 * _FINE)
        write(name, (frame.left + round(x), frame.bottom + 6), align=0.5, color=PALE_INK)
    for speed in np.linspace(-largest[1], largest[1], 5):
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
