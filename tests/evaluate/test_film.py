"""Films: their starts, their numbers, and the program that makes videos."""

from __future__ import annotations

import argparse
import copy
import io
import math
import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pygame
import pytest
from drawn_texts import record_texts, require_legible_texts
from PIL import Image

import keras_pendulum as kp
from keras_pendulum.environments.cartpole import CartPole
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.environments.task import Task
from keras_pendulum.environments.tasks import TASKS
from keras_pendulum.evaluate import film, film_command
from keras_pendulum.evaluate.film import SIZE, draw_frame
from keras_pendulum.figures.drawing import Writer
from keras_pendulum.figures.moment import ShownEpisode
from keras_pendulum.figures.scenes import SCENES, scene
from keras_pendulum.figures.style import CLOCKWISE, COUNTERCLOCKWISE, rgb

TITLES = ("swingup, g = 10 m/s²", "start: hanging")
HANGING, CART = np.array([-1, 0, 0], np.float32), np.array([0.1, 0, 0.02, 0], np.float32)


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

    monkeypatch.setattr("keras_pendulum.optimum.pendulum.best_return", best_return)
    monkeypatch.setattr(film, "draw_frame", lambda *given: given[-1])

    def optimum(task: Task, name: str, angle: float | None = None) -> Any:
        moment: Any = next(film.film_episode(kp.load_policy(name), task, ("", ""), 3, angle))
        return moment.optimal_return

    assert optimum(Pendulum(), "reference") == kp.optimal_return(1.0, [3])[0]
    assert optimum(CartPole(), "cartpole") == 500
    assert found == []
    assert optimum(Pendulum(2.0), "reference", 180.0) == -7
    assert found == [(2.0, [[math.pi, 0.0]], 200)]


def test_film_shows_each_step_with_the_return_of_the_evaluation(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    moments: list[ShownEpisode] = []
    lengths: list[int] = []
    titles: list[tuple[str, str]] = []

    def record(writer: Any, titles_of_frame: tuple[str, str], episode: ShownEpisode) -> Image.Image:
        moments.append(copy.copy(episode))
        lengths.append(len(episode.path))
        titles.append(titles_of_frame)
        return Image.new("RGB", (2, 2), (episode.steps, 0, 0))

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
    assert [moment.steps for moment in moments] == list(range(201))
    assert set(titles) == {("mine, g = 1 m/s²", "start of seed 5")}
    assert moments[-1].total_reward == pytest.approx(score.mean_return)
    assert moments[-1].optimal_return == score.optimal_mean_return
    first = policy(np.asarray(Pendulum().make_env().reset(seed=5)[0]))
    assert [moment.effort for moment in moments[:2]] == [0, first[0]]
    assert lengths == list(range(1, 202))
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


def frame(task: Task, observation: Any, effort: float, titles: Any = TITLES, **numbers: Any) -> Any:
    env: Any = None  # no step is taken
    episode = ShownEpisode(scene(task), env, observation, -295.6, effort, 7, -1.0, -276.5)
    vars(episode).update(numbers)
    return draw_frame(Writer(pygame.Surface(SIZE)), titles, episode)


def test_every_task_can_be_filmed() -> None:
    assert SCENES.keys() == TASKS.keys()


def test_task_without_drawings_is_refused() -> None:
    class Other(Pendulum):
        environment = "Other-v1"

    with pytest.raises(kp.ConfigError, match="Other-v1 cannot be drawn; these can: Pendulum-v1"):
        next(film.film_episode(kp.load_policy("reference"), Other(), ("", ""), 0, None))


def test_frame_shows_the_effort_as_a_bar() -> None:
    white = (255, 255, 255)
    for task, state, most in ((Pendulum(), HANGING, 2.0), (CartPole(), CART, 10.0)):
        bars = []
        for effort in (-most, most):
            picture = frame(task, state, effort)
            assert picture.size == SIZE
            bars.append([picture.getpixel((x, 433)) for x in (150, 250)])
        assert bars == [[rgb(CLOCKWISE), white], [white, rgb(COUNTERCLOCKWISE)]]


def test_torque_beyond_the_largest_stays_in_its_bar() -> None:
    pixels = np.asarray(frame(Pendulum(), HANGING, -9.0))
    assert (pixels == np.asarray(frame(Pendulum(), HANGING, -2.0)))[420:440, :88].all()


def test_frame_shows_the_path() -> None:
    line = [(-1.0, 0.0), (-0.5, 4.0), (0.5, 4.0)]
    one, other = (
        np.asarray(frame(Pendulum(), HANGING, 0.0, path=path)).astype(int)
        for path in (line, [line[-1]])
    )
    changed = np.argwhere((one != other).any(axis=2))
    assert len(changed) and changed[:, 1].min() > 400 and changed[:, 0].max() < 408


def test_edges_of_the_drawing_are_smooth() -> None:
    # Between the red of the rod and the white there are pixels of neither.
    observation = np.array([math.cos(0.3), math.sin(0.3), 0], np.float32)
    scene_pixels = np.asarray(frame(Pendulum(), observation, 0.0))[60:400, 60:340]
    assert len(np.unique(scene_pixels.reshape(-1, 3), axis=0)) > 8


@pytest.mark.parametrize(
    ("task", "state", "numbers"),
    [
        (Pendulum(100.0), HANGING, {"total_reward": -3255.1, "optimal_return": -1758.3}),
        (CartPole(), CART, {"total_reward": 500.0, "optimal_return": 500.0}),
    ],
    ids=["pendulum", "cartpole"],
)
def test_texts_of_a_frame_do_not_overlap_and_are_inside(
    task: Task, state: Any, numbers: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    boxes = record_texts(monkeypatch)
    effort = -scene(task).dynamics.largest_effort
    titles = ("a_longer_name_of_a_file, g = 100 m/s²", "start of seed 4294967295")
    frame(task, state, effort, titles=titles, steps=200, reward=-16.274, **numbers)
    assert len(boxes) == 23
    require_legible_texts(boxes, SIZE)


def test_numbers_of_a_frame_have_no_negative_zero(monkeypatch: pytest.MonkeyPatch) -> None:
    texts: list[str] = []
    monkeypatch.setattr(Writer, "write", lambda self, text, *_, **__: texts.append(text))
    for torque in (-0.01, 0.01):
        numbers = {"reward": -0.0001, "total_reward": -0.04, "optimal_return": -0.001}
        frame(Pendulum(), HANGING, torque, **numbers)
        assert {"0.0 N·m", "0.000"} <= set(texts)
        assert texts.count("0.0") == 2
        texts.clear()
    frame(Pendulum(), HANGING, -2.0, total_reward=-9.96)
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
    pictures = [Image.new("RGB", SIZE, color) for color in ("red", "blue")]
    assert film_command.encode_mp4(film_command.find_ffmpeg(), pictures, 0.05)[4:8] == b"ftyp"
