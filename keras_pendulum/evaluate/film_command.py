"""The flags of `evaluate` that make films, and their work."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from keras_pendulum.cli import nonempty_path, require_ending
from keras_pendulum.display import draw_without_display
from keras_pendulum.environments.tasks import TASKS
from keras_pendulum.errors import UserError
from keras_pendulum.storage.atomic_write import require_no_other_file, write_atomically

if TYPE_CHECKING:
    from keras_pendulum.evaluate.film import Act


def add_film_flags(parser: argparse.ArgumentParser) -> None:
    """Adds --gif, --video and --start."""
    parser.add_argument(
        "--gif", type=nonempty_path, metavar="FILE.gif", help="save a film of the first episode"
    )
    parser.add_argument(
        "--video",
        type=nonempty_path,
        metavar="FILE.mp4",
        help="the same as an MP4 (needs the program ffmpeg)",
    )
    parser.add_argument(
        "--start",
        type=_start,
        metavar="START",
        help="start of the film: hanging, upright, or an angle in degrees, 0 is upright [that of "
        "--seed]",
    )


def require_film_files(arguments: argparse.Namespace) -> None:
    """Raises UserError where the films cannot be made. It is quick, and imports no TensorFlow."""
    if arguments.start is not None and not (arguments.gif or arguments.video):
        raise UserError("--start is the start of a film: add --gif FILE.gif or --video FILE.mp4")
    if arguments.gif:
        require_no_other_file(Path(arguments.gif), b"GIF8", "a GIF")
        require_ending("--gif", arguments.gif, ".gif")
    if arguments.video:
        from keras_pendulum.evaluate.film import find_ffmpeg

        require_ending("--video", arguments.video, ".mp4")
        require_no_other_file(Path(arguments.video), b"ftyp", "an MP4", offset=4)
        find_ffmpeg()


def make_films(
    arguments: argparse.Namespace, act: Act, environment: str, gravity: float | None, name: str
) -> None:
    """Writes the films that the flags ask for.

    Args:
        arguments: of the command line.
        act: the policy.
        environment: Gymnasium's name.
        gravity: m/s²; None for CartPole.
        name: of the policy, to show in the films.
    """
    if not arguments.gif and not arguments.video:
        return
    from keras_pendulum.evaluate.film import (
        encode_gif,
        encode_mp4,
        film_episode,
        find_ffmpeg,
        shown_in_gif,
    )
    from keras_pendulum.evaluate.film_start import require_pendulum

    if arguments.start is not None:
        require_pendulum(environment)
    draw_without_display()
    seconds = TASKS[environment].seconds_per_step
    pictures = list(
        film_episode(
            act, environment, gravity, name=name, seed=arguments.seed, angle=arguments.start
        )
    )
    if arguments.gif:
        write_atomically(arguments.gif, encode_gif(shown_in_gif(pictures, seconds)))
    if arguments.video:
        write_atomically(arguments.video, encode_mp4(find_ffmpeg(), pictures, seconds))


def _start(text: str) -> float:
    from keras_pendulum.evaluate.film_start import parse_start

    return parse_start(text)
