"""Films: their starts, their numbers, and the program that makes videos."""

from __future__ import annotations

import argparse
import io
import math
import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageDraw

import keras_pendulum as kp
from keras_pendulum.environments.cartpole import CartPole
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.environments.task import Task
from keras_pendulum.evaluate import film, film_command
from keras_pendulum.evaluate.film import Moment, draw_frame
from keras_pendulum.figures.style import CLOCKWISE, COUNTERCLOCKWISE, rgb

pytestmark = pytest.mark.quick

TITLES = ("swingup, g = 10 m/s²", "start: hanging")
SCENE = np.full((500, 500, 3), 255, np.uint8)


def test_start_is_a_name_or_an_angle() -> None:
    angles = {"hanging": 180, "upright": 0, "90": 90, "-12.5": -12.5, "-180": -180}
    assert {text: film_command.parse_start(text) for text in angles} == angles
    for text in ("", "down", "nan", "inf", "180.1", "1 2"):
        with pytest.raises(argparse.ArgumentTypeError, match="expected hanging, upright, or an"):
            film_command.parse_start(text)


@pytest.mark.parametrize("angle", [180.0, 0.0, 90.0, -12.5])
def test_reset_puts_the_pendulum_at_the_angle_at_rest(angle: float) -> None:
    env: Any = Pendulum(10.0).make_env()
    env.reset(seed=3)
    observation = Pendulum(10.0).reset_to_angle(env, angle)
    theta = math.radians(angle)
    assert observation == pytest.approx([math.cos(theta), math.sin(theta), 0], abs=1e-6)
    assert observation.dtype == np.float32
    next_observation = env.step(np.array([0.0]))[0]
    speed = 0.05 * 15 * math.sin(theta)
    assert next_observation[2] == pytest.approx(speed, abs=1e-6)
    with pytest.raises(
        kp.ConfigError, match="--start belongs to Pendulum-v1; CartPole-v1 has none"
    ):
        CartPole().reset_to_angle(env, angle)


def test_optimum_of_a_film_is_that_of_its_seed_or_angle(monkeypatch: pytest.MonkeyPatch) -> None:
    found: list[Any] = []

    def best_return(gravity: float, starts: Any, steps: int) -> Any:
        found.append((gravity, starts.tolist(), steps))
        return np.array([-7.0])

    monkeypatch.setattr("keras_pendulum.optimum.best_return.best_return", best_return)
    monkeypatch.setattr(film, "draw_frame", lambda pixels, moment: moment)

    def optimum(task: Task, name: str, angle: float | None = None) -> Any:
        moment: Any = next(film.film_episode(kp.load_policy(name), task, ("", ""), 3, angle))
        return moment.optimum

    assert optimum(Pendulum(), "reference") == kp.optimal_return(1.0, [3])[0]
    assert optimum(CartPole(), "cartpole") == 500
    assert found == []
    assert optimum(Pendulum(2.0), "reference", 180.0) == -7
    assert found == [(2.0, [[math.pi, 0.0]], 200)]


def test_film_shows_each_step_with_the_return_of_the_evaluation(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    moments: list[Moment] = []

    def record(pixels: Any, moment: Moment) -> Image.Image:
        moments.append(moment)
        return Image.new("RGB", (2, 2), (moment.step, 0, 0))

    monkeypatch.setattr(film, "draw_frame", record)
    policy = kp.load_policy("reference")
    shown: list[int] = []

    def encode(pictures: list[Image.Image]) -> bytes:
        shown.extend(picture.getpixel((0, 0))[0] for picture in pictures)  # type: ignore[index]
        return b""

    monkeypatch.setattr(film_command, "encode_gif", encode)
    arguments = argparse.Namespace(gif=tmp_path / "film.gif", video=None, start=None, seed=5)
    film_command.make_films(arguments, policy, Pendulum(), "mine")
    score = kp.evaluate_policy(policy, 1, seed=5)
    assert [moment.step for moment in moments] == list(range(201))
    assert moments[0].titles == ("mine, g = 1 m/s²", "start of seed 5")
    assert moments[-1].total == pytest.approx(score.mean_return)
    assert moments[-1].optimum == score.optimal_mean_return
    first = policy(np.asarray(Pendulum().make_env().reset(seed=5)[0]))
    assert moments[1].torque == first[0]
    # A GIF shows each second step, and the last one.
    assert shown == list(range(0, 201, 2))


def test_film_names_its_start(monkeypatch: pytest.MonkeyPatch) -> None:
    titles: list[tuple[str, str]] = []

    def film_episode(*words: Any) -> list[Image.Image]:
        titles.append(words[2])
        return []

    monkeypatch.setattr(film, "film_episode", film_episode)
    for angle in (180.0, 0.0, -12.5):
        arguments = argparse.Namespace(gif=None, video=None, start=angle, seed=0)
        film_command.make_films(arguments, kp.load_policy("swingup"), Pendulum(10.0), "swingup")
    starts = ("start: hanging", "start: upright", "start: -12.5°")
    assert titles == [("swingup, g = 10 m/s²", start) for start in starts]


def test_frame_is_cropped_and_shows_the_torque() -> None:
    scene = SCENE.copy()
    scene[:110] = scene[-110:] = 0  # outside the circle of the rod
    bars = []
    for torque in (-2.0, 2.0):
        moment = Moment(TITLES, step=7, steps=200, torque=torque, total=-276.5, optimum=-295.6)
        picture = draw_frame(scene, moment)
        assert picture.size == (320, 448)
        assert picture.getpixel((160, 50)) == (255, 255, 255)
        row = 44 + 320 + 18
        bars.append([picture.getpixel((x, row)) for x in (200, 270)])
    white = (255, 255, 255)
    assert bars == [[rgb(CLOCKWISE), white], [white, rgb(COUNTERCLOCKWISE)]]


@pytest.mark.parametrize("torque", [-2.0, None])
def test_texts_of_a_frame_do_not_overlap_and_are_inside(
    torque: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    boxes: list[tuple[float, float, float, float]] = []
    draw_text = ImageDraw.ImageDraw.text

    def record(self: Any, xy: Any, text: str, fill: Any, font: Any, anchor: str = "la") -> None:
        boxes.append(self.textbbox(xy, text, font=font, anchor=anchor))
        draw_text(self, xy, text, fill, font, anchor=anchor)

    monkeypatch.setattr(ImageDraw.ImageDraw, "text", record)
    titles = ("pendulum_weight, g = 100 m/s²", "start of seed 4294967295")
    moment = Moment(titles, step=200, steps=200, torque=torque, total=-3255.1, optimum=-1758.3)
    picture = draw_frame(SCENE, moment)
    assert len(boxes) == (11 if torque is not None else 7)
    for i, (left, top, right, bottom) in enumerate(boxes):
        assert left >= 0 and top >= 0 and right <= picture.width and bottom <= picture.height
        for other in boxes[:i]:
            apart = right <= other[0] or left >= other[2] or bottom <= other[1] or top >= other[3]
            assert apart, (boxes[i], other)


def test_numbers_of_a_frame_have_no_negative_zero(monkeypatch: pytest.MonkeyPatch) -> None:
    texts: list[str] = []
    monkeypatch.setattr(ImageDraw.ImageDraw, "text", lambda *words, **_: texts.append(words[2]))
    for torque in (-0.01, 0.01):
        draw_frame(SCENE, Moment(TITLES, 1, 200, torque=torque, total=-0.04, optimum=-0.001))
        assert texts.count("0.0 N·m") == 1
        assert texts.count("0.0") == 2
        texts.clear()
    draw_frame(SCENE, Moment(TITLES, 1, 200, torque=-2.0, total=-9.96, optimum=0.0))
    assert {"−2.0 N·m", "−10.0"} <= set(texts)


def test_gif_loops_with_the_pictures() -> None:
    pictures = [Image.new("RGB", (4, 4), color) for color in ("red", "blue", "red")]
    with Image.open(io.BytesIO(film_command.encode_gif(pictures))) as gif:
        assert (gif.n_frames, gif.info["duration"], gif.info["loop"]) == (3, 100, 0)  # type: ignore[attr-defined]


def test_video_without_ffmpeg_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(kp.UserError, match="--video needs the program ffmpeg: install it"):
        film_command.find_ffmpeg()


@pytest.mark.skipif(sys.platform == "win32", reason="the stand-in for ffmpeg is a script")
def test_ffmpeg_gets_the_pictures_and_its_failure_is_one_line(tmp_path: Path) -> None:
    program, pictures = tmp_path / "ffmpeg", [Image.new("RGB", (4, 6))] * 3
    # Writes its words and the number of its input's bytes to its last word, the film.
    program.write_text('#!/bin/sh\nfor film; do :; done; echo "$* $(wc -c)" > "$film"\n')
    program.chmod(0o755)
    words = film_command.encode_mp4(str(program), pictures, 0.05).decode().split()
    assert "4x6" in words
    assert words[words.index("-r") + 1] == "20"
    assert words[-1] == str(3 * 4 * 6 * 3)
    program.write_text("#!/bin/sh\necho first >&2; echo second >&2; exit 1\n")
    with pytest.raises(kp.UserError, match=r"^ffmpeg failed: first.*second$") as caught:
        film_command.encode_mp4(str(program), pictures, 0.05)
    assert "\n" not in str(caught.value)


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="ffmpeg is not installed")
def test_video_is_an_mp4() -> None:
    pictures = [Image.new("RGB", (320, 448), color) for color in ("red", "blue")]
    assert film_command.encode_mp4(film_command.find_ffmpeg(), pictures, 0.05)[4:8] == b"ftyp"
