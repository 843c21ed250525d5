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
from keras_pendulum.figures.moment import BELOW, ShownEpisode, draw_moment
from keras_pendulum.figures.scenes import scene
from keras_pendulum.optimum.solutions import solution

if TYPE_CHECKING:
    from keras_pendulum.environments.task import Task

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
        episode = ShownEpisode(drawn, env, observation, optimum)
        yield draw_frame(writer, titles, episode)
        while not episode.done:
            episode.step(policy.action(episode.observation))
            yield draw_frame(writer, titles, episode)


def draw_frame(writer: Writer, titles: tuple[str, str], episode: ShownEpisode) -> Image.Image:
    """Returns the picture of a step, under its titles; the writer's surface has the SIZE."""
    screen, write = writer.screen, writer.write
    screen.fill(PAPER)
    write(titles[0], (16, 11), LARGE)
    write(titles[1], (_WIDTH - 16, 14), align=1.0, color=PALE_INK)
    place = pygame.Rect(0, _TOP, _WIDTH, _HEIGHT - _TOP)
    draw_moment(writer, place, episode)
    return Image.frombytes("RGB", SIZE, pygame.image.tobytes(screen, "RGB"))
