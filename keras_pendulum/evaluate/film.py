"""Films of episodes: one episode as pictures with its numbers, and the files of such pictures."""

from __future__ import annotations

import contextlib
import io
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.environments.tasks import TASKS, make_environment
from keras_pendulum.errors import UserError, one_line
from keras_pendulum.evaluate.film_frame import Moment, draw_frame
from keras_pendulum.evaluate.film_start import describe_start, optimum_of_start, reset

if TYPE_CHECKING:
    from PIL.Image import Image

Act = Callable[[NDArray[np.float32]], Any]  # observation -> action as the environment takes it
GIF_SECONDS = 0.1  # of a frame; many programs show shorter ones too slowly


def film_episode(
    act: Act,
    environment: str,
    gravity: float | None,
    *,
    name: str,
    seed: int = 0,
    angle: float | None = None,
) -> Iterator[Image]:
    """Yields a picture of the start and of each step of an episode.

    Args:
        act: the policy.
        environment: Gymnasium's name.
        gravity: m/s²; None for CartPole.
        name: of the policy, for the first line of the pictures.
        seed: of the start, where there is no angle.
        angle: of the pendulum's start, in degrees from upright.
    """
    optimum = optimum_of_start(environment, gravity, seed, angle)
    physics = "" if gravity is None else f", g = {gravity:g} m/s²"
    titles = f"{name}{physics}", describe_start(seed, angle)
    steps = TASKS[environment].steps_per_episode
    with contextlib.closing(make_environment(environment, gravity, "rgb_array")) as env:
        observation = reset(env, seed, angle)
        torque = 0.0 if TASKS[environment].has_torque else None
        moment = Moment(titles, step=0, steps=steps, torque=torque, total=0.0, optimum=optimum)
        yield draw_frame(_pixels(env), moment)
        done = False
        while not done:
            action = act(observation)
            observation, reward, terminated, truncated, _ = env.step(action)
            done = terminated or truncated
            if torque is not None:
                torque = float(np.reshape(action, -1)[0])
            moment = moment.after(float(reward), torque)
            yield draw_frame(_pixels(env), moment)


def encode_gif(pictures: Sequence[Image], seconds_per_frame: float = GIF_SECONDS) -> bytes:
    """Returns a looping GIF."""
    stream = io.BytesIO()
    pictures[0].save(
        stream,
        format="GIF",
        save_all=True,
        append_images=pictures[1:],
        duration=round(1000 * seconds_per_frame),
        loop=0,
    )
    return stream.getvalue()


def shown_in_gif(pictures: Sequence[Image], seconds_per_step: float) -> Sequence[Image]:
    """Returns the pictures of steps that a GIF shows; the last step is among them."""
    interval = round(GIF_SECONDS / seconds_per_step)
    return pictures[(len(pictures) - 1) % interval :: interval]


def find_ffmpeg() -> str:
    """Returns the path of the program ffmpeg. Raises UserError where it is not installed."""
    path = shutil.which("ffmpeg")
    if path is None:
        raise UserError("--video needs the program ffmpeg: install it, or make a film with --gif")
    return path


def encode_mp4(ffmpeg: str, pictures: Sequence[Image], seconds_per_frame: float) -> bytes:
    """Returns an MP4 film that browsers show.

    Args:
        ffmpeg: path of the program.
        pictures: of equal size, whose sides are even numbers.
        seconds_per_frame: how long each is shown.

    Raises UserError when ffmpeg fails.
    """
    width, height = pictures[0].size
    with tempfile.TemporaryDirectory() as folder:
        film = Path(folder) / "film.mp4"
        words = [ffmpeg, "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24"]
        words += ["-s", f"{width}x{height}", "-r", f"{1 / seconds_per_frame:g}", "-i", "-"]
        words += ["-pix_fmt", "yuv420p", "-movflags", "+faststart", os.fspath(film)]
        frames = b"".join(picture.convert("RGB").tobytes() for picture in pictures)
        try:
            done = subprocess.run(words, input=frames, capture_output=True, check=False)
        except OSError as error:
            raise UserError(f"cannot start {ffmpeg}: {error.strerror}") from error
        if done.returncode or not film.exists():
            reason = one_line(done.stderr.decode(errors="replace").strip() or "no film")
            raise UserError(f"ffmpeg failed: {reason}")
        return film.read_bytes()


def _pixels(env: Any) -> NDArray[np.uint8]:
    return np.asarray(env.render())
