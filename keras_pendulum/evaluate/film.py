"""The film of an episode: a picture of each step, as the game shows it."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Iterator
from typing import TYPE_CHECKING

import pygame
from PIL import Image

from keras_pendulum.evaluate.policy import Policy
from keras_pendulum.figures.drawing import LARGE, PALE_INK, PAPER, Writer
from keras_pendulum.figures.moment import BELOW, Moment, draw_moment
from keras_pendulum.figures.scenes import scene
from keras_pendulum.optimum.solutions import solution

if TYPE_CHECKING:
    from keras_pendulum.environments.task import Task
    from keras_pendulum.figures.scene import Scene

_log = logging.getLogger(__name__)

_TOP = 44  # pixels, height of the titles
SIZE = _WIDTH, _HEIGHT = 800, _TOP + 364 + BELOW  # even, as MP4 needs


def film_episode(
    policy: Policy, task: Task, titles: tuple[str, str], seed: int, angle: float | None
) -> Iterator[Image.Image]:
    """Yields a picture of the start and of each step of an episode, between two titles.

    The start is that of the seed, or with an angle in degrees, at rest, counterclockwise from
    upright. The optimum of such a start is computed, which takes some 20 s. Raises ConfigError for
    an angle where the start cannot be chosen, and for a task without drawings.
    """
    drawn = scene(task)
    with contextlib.closing(task.make_env()) as env:
        observation, _ = env.reset(seed=seed)
        if angle is None:
            optimum = float(solution(task).best_returns([seed])[0])
        else:
            observation = task.reset_to_angle(env, angle)
            _log.warning("Computing the best possible return of the film's start: about 20 s")
            optimum = solution(task).best_return_at(angle)
        policy.reset()
        writer = Writer(pygame.Surface(SIZE))
        path = [drawn.state(observation)]
        step, effort, reward, total, done = 0, 0.0, 0.0, 0.0, False
        while True:
            moment = Moment(
                observation=observation,
                effort=effort,
                step=step,
                steps=task.steps_per_episode,
                reward=reward,
                total_reward=total,
                optimal_return=optimum,
                path=path,
            )
            yield draw_frame(writer, drawn, titles, moment)
            if done:
                return
            action = policy.action(observation)
            observation, given, terminated, truncated, _ = env.step(action)
            reward, effort = float(given), drawn.effort_of_action(action)
            done = terminated or truncated
            step, total = step + 1, total + reward
            path.append(drawn.state(observation))


def draw_frame(
    writer: Writer, drawn: Scene, titles: tuple[str, str], moment: Moment
) -> Image.Image:
    """Returns the picture of a step, under its titles; the writer's surface has the SIZE."""
    screen, write = writer.screen, writer.write
    screen.fill(PAPER)
    write(titles[0], (16, 11), LARGE)
    write(titles[1], (_WIDTH - 16, 14), align=1.0, color=PALE_INK)
    place = pygame.Rect(0, _TOP, _WIDTH, _HEIGHT - _TOP)
    draw_moment(screen, write, place, drawn, moment)
    return Image.frombytes("RGB", SIZE, pygame.image.tobytes(screen, "RGB"))
