"""The flags of `evaluate` that make films, and the files of these films."""

from __future__ import annotations

import argparse
import io
import math
import os
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from keras_pendulum.cli import nonempty_path, require_ending
from keras_pendulum.errors import UserError, one_line
from keras_pendulum.status import status
from keras_pendulum.storage.atomic_write import require_no_other_file, write_atomically

if TYPE_CHECKING:
    from PIL.Image import Image

    from keras_pendulum.environments.task import Task
    from keras_pendulum.evaluate.policy import Policy

_STARTS = {"hanging": 180.0, "upright": 0.0}  # angles in degrees
_GIF_SECONDS = 0.1  # of a frame; many programs show shorter ones too slowly
_GIF_COLORS = 64
_GIF_SAMPLE = 10  # pictures that the colours are taken from


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
        type=parse_start,
        metavar="START",
        help="start of the film: hanging, upright, or an angle in degrees, 0 is upright [that of "
        "--seed]",
    )


def parse_start(text: str) -> float:
    """Returns the angle in degrees. Raises ArgumentTypeError for any other text."""
    try:
        angle = _STARTS[text] if text in _STARTS else float(text)
    except ValueError:
        angle = math.nan
    if not -180 <= angle <= 180:  # written so that NaN fails too
        raise argparse.ArgumentTypeError(
            f"{text!r} is not a start: expected hanging, upright, or an angle from -180 to 180 "
            "(°, 0 is upright)"
        )
    return angle


def require_film_files(arguments: argparse.Namespace) -> None:
    """Raises UserError where the films cannot be made. It is quick, and imports no TensorFlow."""
    if arguments.start is not None and not (arguments.gif or arguments.video):
        raise UserError("--start is the start of a film: add --gif FILE.gif or --video FILE.mp4")
    if arguments.gif:
        require_no_other_file(Path(arguments.gif), b"GIF8", "a GIF")
        require_ending("--gif", arguments.gif, ".gif")
    if arguments.video:
        require_ending("--video", arguments.video, ".mp4")
        require_no_other_file(Path(arguments.video), b"ftyp", "an MP4", offset=4)
        find_ffmpeg()


def make_films(arguments: argparse.Namespace, policy: Policy, task: Task, name: str) -> None:
    """Writes the films that the flags ask for; they show the name.

    Raises ConfigError for --start where the start cannot be chosen.
    """
    from keras_pendulum.evaluate.film import film_episode

    seed, angle = arguments.seed, arguments.start
    start = f"start of seed {seed}"
    if angle is not None:
        names = {named_angle: name for name, named_angle in _STARTS.items()}
        start = f"start: {names.get(angle, f'{angle:g}°')}"
    _, *physics = task.name.split(", ")
    title = ", ".join([name, *(f"{each} m/s²" for each in physics)])
    with status("Drawing the film"):
        pictures = list(film_episode(policy, task, (title, start), seed, angle))
    if arguments.gif:
        # Some steps are left out, but not the last one.
        interval = round(_GIF_SECONDS / task.seconds_per_step)
        shown = pictures[(len(pictures) - 1) % interval :: interval]
        write_atomically(arguments.gif, encode_gif(shown))
        print(f"Wrote {arguments.gif}")
    if arguments.video:
        film = encode_mp4(find_ffmpeg(), pictures, task.seconds_per_step)
        write_atomically(arguments.video, film)
        print(f"Wrote {arguments.video}")


def encode_gif(pictures: Sequence[Image]) -> bytes:
    """Returns a looping GIF. Its pictures share one palette, which makes the file smaller."""
    from PIL import Image

    width, height = pictures[0].size
    some = pictures[:: max(1, len(pictures) // _GIF_SAMPLE)]
    sample = Image.new("RGB", (width, height * len(some)))
    for i, picture in enumerate(some):
        sample.paste(picture, (0, height * i))
    palette = sample.quantize(_GIF_COLORS, dither=Image.Dither.NONE)
    first, *others = (each.quantize(palette=palette, dither=Image.Dither.NONE) for each in pictures)
    stream = io.BytesIO()
    first.save(
        stream,
        format="GIF",
        save_all=True,
        append_images=others,
        duration=round(1000 * _GIF_SECONDS),
        loop=0,
    )
    return stream.getvalue()


def find_ffmpeg() -> str:
    """Returns the path of the program ffmpeg. Raises UserError where it is not installed."""
    path = shutil.which("ffmpeg")
    if path is None:
        raise UserError("--video needs the program ffmpeg: install it, or make a film with --gif")
    return path


def encode_mp4(ffmpeg: str, pictures: Sequence[Image], seconds_per_frame: float) -> bytes:
    """Returns an MP4 film that browsers show; the sides of the pictures are even numbers.

    Raises UserError when ffmpeg fails.
    """
    width, height = pictures[0].size
    with tempfile.TemporaryDirectory() as folder:
        film = Path(folder) / "film.mp4"
        words = [ffmpeg, "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24"]
        words += ["-s", f"{width}x{height}", "-r", f"{1 / seconds_per_frame:g}", "-i", "-"]
        words += ["-pix_fmt", "yuv420p", "-movflags", "+faststart", os.fspath(film)]
        frames = b"".join(picture.convert("RGB").tobytes() for picture in pictures)
        done = subprocess.run(words, input=frames, capture_output=True, check=False)
        if done.returncode:
            reason = one_line(done.stderr.decode(errors="replace").strip())
            raise UserError(f"ffmpeg failed: {reason}")
        return film.read_bytes()
