"""The game: without a display, and in real windows that receive keys."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pygame
import pytest
from conftest import Command, Refusal, command_line, wait_for
from drawn_texts import record_texts, require_legible_texts
from numpy.typing import NDArray

import keras_pendulum as kp
from keras_pendulum.environments.cartpole import CartPole
from keras_pendulum.environments.pendulum import STEPS_PER_EPISODE, Pendulum
from keras_pendulum.environments.tasks import TASKS
from keras_pendulum.evaluate import __main__ as evaluate_command
from keras_pendulum.evaluate.policy import Policy
from keras_pendulum.evaluate.sources import as_policy
from keras_pendulum.figures import drawing
from keras_pendulum.figures.drawing import Writer
from keras_pendulum.figures.moment import draw_portrait
from keras_pendulum.figures.scenes import scene
from keras_pendulum.figures.style import CLOCKWISE, COUNTERCLOCKWISE, rgb
from keras_pendulum.play import __main__ as play_command
from keras_pendulum.play.controls import CONTROLS
from keras_pendulum.play.game import READY_FRAMES, Game, Key
from keras_pendulum.play.window import Window, control_c, play

NO_DISPLAY = {"DISPLAY": "", "WAYLAND_DISPLAY": "", "SDL_VIDEODRIVER": ""}
CLOSED = "error: the window was closed before the end of the last episode\n"
STEP = re.compile(r"Step: (\d+), (?:Torque|Force): (\S+), Reward: (\S+), Return: (\S+)")


@dataclass
class Player:
    """A clock that presses keys at the end of a frame, and then records the window's pixels."""

    keys: Mapping[int, Any]  # frame -> keys of pygame (negative: released) or pygame.QUIT
    lines: list[str] = field(default_factory=list)
    frames: int = 0
    pixels: dict[int, Any] = field(default_factory=dict)  # by frame [1000, 640, 3]

    def end_frame(self) -> None:
        self.frames += 1
        assert self.frames < 5000, "the game does not end"
        if self.frames in self.keys:
            surface = pygame.display.get_surface()
            assert surface is not None
            self.pixels[self.frames] = pygame.surfarray.array3d(surface)
            for key in np.atleast_1d(self.keys[self.frames]).tolist():
                if key == pygame.QUIT:
                    pygame.event.post(pygame.event.Event(pygame.QUIT))
                elif key < 0:
                    pygame.event.post(pygame.event.Event(pygame.KEYUP, key=-key))
                else:
                    pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=key))

    @property
    def torques(self) -> list[float]:
        return [float(match[2]) for match in self._steps()]

    @property
    def rewards(self) -> list[float]:
        return [float(match[3]) for match in self._steps()]

    @property
    def scores(self) -> list[str]:
        return [line for line in self.lines if line.startswith("you ")]

    def _steps(self) -> list[re.Match[str]]:
        return [match for line in self.lines if (match := STEP.fullmatch(line))]


@pytest.fixture
def no_window(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    yield
    pygame.quit()


def play_game(keys: Mapping[int, Any], **settings: Any) -> Player:
    """Plays a whole game, pressing `keys[i]` at the end of frame i."""
    player = Player(keys)
    settings = {"seed": 3, "print_steps": True} | settings
    task = settings.pop("task", None) or Pendulum(settings.pop("gravity", 1.0))
    game = Game(task, **settings, print_line=player.lines.append)
    play(game, Window(player.end_frame), lambda: None)
    game.close()
    return player


def gymnasium_rewards(torques: list[float], seed: int, gravity: float = 1.0) -> list[float]:
    env = Pendulum(gravity).make_env()
    env.reset(seed=seed)
    return [float(env.step(np.array([torque]))[1]) for torque in torques]


KEYS = {"j": -2, "l": 2, "k": 0, "LEFT": 2, "RIGHT": -2, "DOWN": 0, "UP": 0}


@pytest.mark.parametrize(("key", "torque"), KEYS.items())
def test_key_starts_and_its_torque_acts_until_the_next_key(
    key: str, torque: float, no_window: None
) -> None:
    other = pygame.K_j if torque == 2 else pygame.K_l
    player = play_game({1: other, 4: getattr(pygame, f"K_{key}"), 12: pygame.K_ESCAPE})
    assert player.torques == [-2 if other == pygame.K_j else 2] * 3 + [torque] * 8


def test_every_task_is_played() -> None:
    assert CONTROLS.keys() == TASKS.keys()


@pytest.mark.parametrize(("key", "force"), [("j", -10), ("RIGHT", 10)])
def test_key_pushes_the_cart_and_without_one_the_pushes_alternate(
    key: str, force: int, no_window: None
) -> None:
    keys = {1: getattr(pygame, f"K_{key}"), 5: pygame.K_k, 9: pygame.K_ESCAPE}
    player = play_game(keys, task=CartPole(), seed=7)
    assert player.torques == [force] * 4 + [-10, 10] * 2
    assert player.lines[0] == "Start: seed 7, CartPole-v1"
    assert player.scores == ["you 8 after 8 of 500 steps"]


def test_pole_that_falls_ends_the_drive_and_the_network_balances_it(no_window: None) -> None:
    agent = kp.load_policy("cartpole")
    keys = {1: pygame.K_l, 40: pygame.K_RETURN, 45: pygame.K_ESCAPE}
    player = play_game(keys, task=CartPole(), seed=7, policy=agent)
    env = CartPole().make_env()
    env.reset(seed=7)
    steps = 1
    while not env.step(1)[2]:
        steps += 1
    assert player.scores == [f"you {steps} · agent 500 · best possible 500"]
    assert len(player.torques) == steps < 15


@pytest.mark.parametrize("task", [Pendulum(), CartPole()], ids=["pendulum", "cartpole"])
def test_held_key_acts_until_it_is_released(task: Any, no_window: None) -> None:
    keys = {1: [pygame.K_h, pygame.K_l], 4: -pygame.K_l, 7: [pygame.K_j, -pygame.K_l]}
    player = play_game({**keys, 9: [-pygame.K_j, pygame.K_ESCAPE]}, task=task)
    push = scene(task).dynamics.largest_effort
    without = [push, -push, push] if isinstance(task, CartPole) else [0.0] * 3
    assert player.torques == [push] * 3 + without + [-push] * 2


def test_released_key_acts_on_without_the_switch(no_window: None) -> None:
    keys = {1: pygame.K_l, 3: -pygame.K_l, 5: [pygame.K_h, pygame.K_h], 7: pygame.K_ESCAPE}
    assert play_game(keys).torques == [2] * 4 + [0] * 2


def test_game_starts_without_a_key_and_without_torque(no_window: None) -> None:
    player = play_game({READY_FRAMES + 5: pygame.K_ESCAPE})
    assert player.torques == [0] * 5


def test_score_is_the_sum_of_gymnasium_rewards(no_window: None) -> None:
    keys = {1: pygame.K_l, 30: pygame.K_j, 55: pygame.K_k, 80: pygame.K_RIGHT, 100: pygame.K_LEFT}
    player = play_game({**keys, 240: pygame.K_ESCAPE}, seed=7, gravity=10.0)
    assert len(player.torques) == STEPS_PER_EPISODE
    assert set(player.torques) == {-2, 0, 2}
    rewards = gymnasium_rewards(player.torques, seed=7, gravity=10.0)
    assert player.rewards == [round(reward, 3) for reward in rewards]
    optimum = kp.optimal_return(10.0, [7])[0]
    assert player.scores == [f"you {sum(rewards):.1f} · best possible {optimum:.1f}"]
    assert player.lines[0] == "Start: seed 7, Pendulum-v1, g = 10"
    assert player.lines[-1] == player.scores[0]  # leaving after the score prints nothing


def test_r_restarts_the_same_start_without_torque(no_window: None) -> None:
    player = play_game({1: pygame.K_l, 21: pygame.K_r, 21 + READY_FRAMES + 3: pygame.K_ESCAPE})
    assert player.torques == [2] * 20 + [0] * 3
    assert player.rewards[20:] == [round(r, 3) for r in gymnasium_rewards([0] * 3, seed=3)]
    assert player.scores == [f"you {sum(player.rewards[20:]):.1f} after 3 of 200 steps"]


@pytest.mark.parametrize("end", [pygame.K_ESCAPE, pygame.QUIT], ids=["ESC", "closed"])
def test_leaving_prints_the_score_so_far_and_takes_no_further_step(
    end: int, no_window: None
) -> None:
    player = play_game({1: pygame.K_j, 11: [end, pygame.K_ESCAPE]}, print_steps=False)
    score = f"you {sum(gymnasium_rewards([-2] * 10, seed=3)):.1f} after 10 of 200 steps"
    assert player.frames == 11
    assert player.lines == ["Start: seed 3, Pendulum-v1, g = 1", score]


def test_after_the_score_r_repeats_the_start_and_enter_plays_the_next(no_window: None) -> None:
    over = 1 + STEPS_PER_EPISODE
    player = play_game(
        {
            1: pygame.K_l,
            over + 2: pygame.K_j,  # a torque key leaves the score on the screen
            over + 5: pygame.K_r,
            over + 6: pygame.K_l,
            2 * over + 10: pygame.K_RETURN,
            2 * over + 11: pygame.K_l,
            2 * over + 14: pygame.K_ESCAPE,
        },
        seed=999,
    )
    assert len(player.torques) == 2 * STEPS_PER_EPISODE + 3
    assert player.scores[0] == player.scores[1]
    # 999 is the last seed of USUAL_SEEDS.
    assert [line for line in player.lines if "seed" in line] == [
        "Start: seed 999, Pendulum-v1, g = 1",
        "Start: seed 0, Pendulum-v1, g = 1",
    ]
    assert player.rewards[-3:] == [round(r, 3) for r in gymnasium_rewards([2] * 3, seed=0)]


def test_window_shows_torque_pendulum_and_numbers(no_window: None) -> None:
    player = play_game({1: pygame.K_l, 10: pygame.K_j, 20: pygame.K_j, 21: pygame.K_ESCAPE})
    assert player.pixels[1].shape == (1000, 640, 3)
    middle, height = 250, 529  # of the bar of the torque
    right, left = (middle + 50, height), (middle - 50, height)
    frames = player.pixels.values()
    colours = [[tuple(pixels[point]) for point in (left, right)] for pixels in frames]
    empty, blue = drawing.WHITE, rgb(CLOCKWISE)
    red = rgb(COUNTERCLOCKWISE)
    assert colours == [[empty, empty], [empty, red], [blue, empty], [blue, empty]]
    for band in ((0, 40), (60, 480), (560, 605)):  # title, pendulum, numbers
        rows = slice(*band)
        changed = (player.pixels[20][:, rows] != player.pixels[21][:, rows]).any()
        assert changed == (band[0] > 0)


def test_no_text_overlaps_another_or_leaves_the_window(
    no_window: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    boxes, show = record_texts(monkeypatch), Window.show

    def check(self: Window, game: Game) -> None:
        show(self, game)
        require_legible_texts(boxes, self._screen.get_size())
        boxes.clear()

    monkeypatch.setattr(Window, "show", check)
    policy = as_policy(lambda observation: -2.0)
    keys = {1: [pygame.K_h, pygame.K_l], 405: pygame.K_ESCAPE}
    assert play_game(keys, seed=999, gravity=10.0, policy=policy).frames == 405
    keys = {1: [pygame.K_h, pygame.K_l], 600: pygame.K_ESCAPE}
    agent = kp.load_policy("cartpole")
    assert play_game(keys, seed=999, task=CartPole(), policy=agent).frames == 600


def portrait(path: Any, earlier: Any = ()) -> Any:
    """Returns the pixels [1000, 640, 3] of a phase portrait."""
    screen = pygame.Surface((1000, 640))
    screen.fill(drawing.WHITE)
    place = pygame.Rect(500, 48, 500, 456)
    draw_portrait(Writer(screen), place, scene(Pendulum()), path, earlier)
    return pygame.surfarray.array3d(screen)


def test_portrait_shows_the_path_and_that_of_the_player() -> None:
    start, lines = (-1.0, 0.0), [(-1.0, 0.0), (-0.5, 4.0), (0.5, 4.0)]
    pictures = (portrait([start]), portrait(lines), portrait([start], lines))
    empty, path, earlier = (each[700:800, 140:220].sum(axis=2).min() for each in pictures)
    assert path < earlier < empty  # the darkest pixel


def test_path_does_not_cross_the_portrait_where_the_angle_jumps() -> None:
    assert (portrait([(3.1, 2.0)]) == portrait([(-3.1, 2.0), (3.1, 2.0)])).all()


def drawn(task: Any, observation: list[float], effort: float) -> NDArray[np.int_]:
    """Returns the pixels [500, 456, 3] of a task."""
    picture = scene(task).draw(np.array(observation, np.float32), effort, (500, 456))
    return pygame.surfarray.array3d(picture).astype(int)


@pytest.mark.parametrize(
    ("task", "observation", "side"),
    [
        (CartPole(), [0, 0, -0.2, 0], "left"),
        (CartPole(), [0, 0, 0.2, 0], "right"),
        (Pendulum(), [0, 1, 0], "left"),  # π/2, counter-clockwise from upright
        (Pendulum(), [0, -1, 0], "right"),
    ],
    ids=str,
)
def test_rod_leans_to_the_side_of_its_angle(task: Any, observation: list[float], side: str) -> None:
    rod = (abs(drawn(task, observation, 0.0) - drawing.ROD).sum(axis=2) < 30).sum(axis=1)
    assert (rod[:250].sum() > 3 * rod[250:].sum()) == (side == "left")


def test_arrow_of_the_torque_has_a_white_border_on_the_rod() -> None:
    hanging = drawn(Pendulum(), [-1, 0, 0], 2.0)
    below = hanging[250, 228 + 20 :]  # from the pivot down, along the rod
    colors = {"rod": drawing.ROD, "arrow": rgb(COUNTERCLOCKWISE), "border": drawing.WHITE}
    crossed: list[str] = []
    for pixel in below[:150]:
        for name, color in colors.items():  # the pixel between two colors has neither
            if abs(pixel - color).sum() < 20 and crossed[-1:] != [name]:
                crossed.append(name)
    assert crossed == ["rod", "border", "arrow", "border", "rod"]


def test_window_says_that_it_loads_before_the_policy_is_loaded(
    no_window: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[str] = []
    write = Writer.write

    def record(self: Writer, text: str, *options: Any, **named: Any) -> None:
        shown.append(text)
        write(self, text, *options, **named)

    def load(*_: object) -> None:
        assert shown == ["Loading the policy of reference.h5 …"]
        screen = pygame.display.get_surface()
        assert screen is not None
        assert len(np.unique(pygame.surfarray.array3d(screen).reshape(-1, 3), axis=0)) > 5
        raise kp.UserError("enough")

    monkeypatch.setattr(Writer, "write", record)
    monkeypatch.setattr(play_command, "_load_policy", load)
    assert play_command.main(["--against", "reference"]) == 2
    assert len(shown) == 1
    assert not pygame.display.get_init()  # the window is closed


def test_strip_along_the_lower_edge_grows_with_the_episode(no_window: None) -> None:
    player = play_game({1: pygame.K_l, 101: pygame.K_j, 201: pygame.K_ESCAPE})
    row = 502
    rows = [pixels[:, row] for pixels in player.pixels.values()]
    strips = [(row_pixels == drawing.LINE).all(axis=-1) for row_pixels in rows]
    assert [int(strip.sum()) for strip in strips] == [0, 500, 1000]
    assert strips[1][:500].all()


@pytest.fixture(scope="module")
def agent() -> Policy:
    return kp.load_policy("reference")


def test_agent_drives_the_same_start_and_three_returns_are_printed(
    agent: Policy, no_window: None
) -> None:
    over = 1 + 2 * STEPS_PER_EPISODE
    player = play_game({1: pygame.K_l, over + 10: pygame.K_ESCAPE}, seed=11, policy=agent)
    you = sum(gymnasium_rewards([2] * STEPS_PER_EPISODE, seed=11))
    score = kp.evaluate_policy(agent, 1, seed=11)
    assert player.scores == [
        f"you {you:.1f} · agent {score.mean_return:.1f} · "
        f"best possible {score.optimal_mean_return:.1f}"
    ]
    assert len(player.torques) == STEPS_PER_EPISODE  # only the player's steps are printed


@pytest.mark.parametrize("key", [pygame.K_SPACE, pygame.K_RETURN], ids=["space", "enter"])
def test_key_skips_to_the_score_of_the_agent(key: int, agent: Policy, no_window: None) -> None:
    over = 1 + STEPS_PER_EPISODE
    player = play_game({1: pygame.K_l, over + 5: key, over + 7: pygame.K_ESCAPE}, policy=agent)
    score = kp.evaluate_policy(agent, 1, seed=3)
    assert f"agent {score.mean_return:.1f} · best" in player.scores[0]
    assert player.frames == over + 7


def test_leaving_while_the_agent_drives_prints_the_score_of_the_player(
    agent: Policy, no_window: None
) -> None:
    over = 1 + STEPS_PER_EPISODE
    player = play_game({1: pygame.K_l, over + 5: pygame.K_ESCAPE}, policy=agent)
    you = sum(gymnasium_rewards([2] * STEPS_PER_EPISODE, seed=3))
    optimum = kp.optimal_return(1.0, [3])[0]
    assert player.scores == [f"you {you:.1f} · best possible {optimum:.1f}"]


@pytest.fixture
def played(no_window: None, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The task, seed, policy and flag of each game that the command would play."""
    games: list[Any] = []

    def record(window: Window, check_control_c: object, *game: Any) -> int:
        games.append(game)
        return 0

    monkeypatch.setattr(play_command, "_run_game", record)
    return games


@pytest.mark.parametrize(
    ("words", "gravity"),
    [
        ([], 1.0),
        (["--gravity", "3"], 3.0),
        (["--against", "reference"], 1.0),
        (["--against", "swingup"], 10.0),
        (["--against", "swingup", "--gravity", "0"], 0.0),
        (["--against", "cartpole"], None),
        (["--environment", "CartPole-v1"], None),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_gravity_is_the_flag_or_the_recorded_one_or_1(
    words: list[str], gravity: float | None, played: list[Any]
) -> None:
    assert play_command.main([*words, "--seed", "7"]) == 0
    ((task, seed, policy, _),) = played
    expected = CartPole() if gravity is None else Pendulum(gravity)
    assert (task, seed, policy is not None) == (expected, 7, "--against" in words)


def test_policy_without_a_recorded_gravity_plays_where_it_is_better(
    tmp_path: Path, played: list[Any], capsys: pytest.CaptureFixture[str]
) -> None:
    shipped = kp.load_weights("swingup")
    network = kp.DQN(shipped.hidden_units, shipped.action_count, activation=shipped.activation)
    network.set_weights(shipped.get_weights())
    kp.save_weights(network, tmp_path / "mine.h5")
    assert play_command.main(["--against", str(tmp_path / "mine.h5")]) == 0
    assert "records no gravity" in capsys.readouterr().out
    assert play_command.main(["--against", str(tmp_path / "mine.h5"), "--gravity", "3"]) == 0
    assert "records no gravity" not in capsys.readouterr().out
    assert [task for task, *_ in played] == [Pendulum(10.0), Pendulum(3.0)]


# Plays in a window that is closed at once.
PLAY = """
import sys
import pygame
from keras_pendulum.play.__main__ import main

pygame.display.init()
pygame.event.post(pygame.event.Event(pygame.QUIT))
assert main(["--seed", "4"]) == 0
assert not {"tensorflow", "keras", "h5py", "matplotlib"} & set(sys.modules)
"""


def test_play_without_a_policy_imports_no_tensorflow() -> None:
    done = subprocess.run(
        [sys.executable, "-c", PLAY],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "SDL_VIDEODRIVER": "dummy"},
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert re.fullmatch(
        r"(pygame .*\n.*\n)?Start: seed 4, Pendulum-v1, g = 1\nyou .*\n", done.stdout
    )


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--against", "missing.h5"], "missing.h5: no such file"),
        (["--against", "text.h5"], "text.h5: not an HDF5 file"),
        (["--against", "cartpole", "--gravity", "2"], "gravity belongs to Pendulum-v1"),
        (["--environment", "CartPole-v1", "--gravity", "2"], "gravity belongs to Pendulum-v1"),
        (
            ["--environment", "CartPole-v1", "--against", "swingup"],
            "swingup is an agent of Pendulum-v1, not of CartPole-v1",
        ),
        (["--against", ""], "the name is empty"),
        (["--gravity", "nan", "--against", "missing.h5"], "gravity is nan"),
        (["--seed", "-1", "--against", "missing.h5"], "seed is -1"),
    ],
    ids=lambda value: str(value)[:40],
)
def test_mistake_prints_one_line_and_opens_no_window(
    words: list[str], message: str, no_window: None, refusal: Refusal
) -> None:
    assert message in refusal(play_command.main, words)
    assert not pygame.display.get_init() or pygame.display.get_surface() is None


@pytest.mark.parametrize("display", ["", ":9999"], ids=["none", "wrong"])
def test_missing_display_prints_one_line(display: str, in_process: Command) -> None:
    pygame.quit()
    done = in_process("play", "--seed", "1", environment={**NO_DISPLAY, "DISPLAY": display})
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "error: there is no display to open a window on\n"


Environment = dict[str, str]


@pytest.fixture
def screen() -> Iterator[Environment]:
    """The environment of a command whose window is on the screen of an X server of its own."""
    missing = [name for name in ("Xvfb", "xdotool") if shutil.which(name) is None]
    if missing:
        reason = f"a real window needs {' and '.join(missing)} (packages xvfb and xdotool)"
        if os.environ.get("CI"):
            pytest.fail(reason, pytrace=False)
        pytest.skip(reason)
    reading, writing = os.pipe()
    # Without -noreset the server restarts when its last client ends, and refuses clients meanwhile.
    words = ["Xvfb", "-displayfd", str(writing), "-screen", "0", "1280x800x24", "-noreset"]
    with subprocess.Popen(words, pass_fds=[writing], stderr=subprocess.DEVNULL) as server:
        os.close(writing)
        with os.fdopen(reading) as pipe:  # the server writes its number when it is ready
            number = pipe.readline().strip()
        yield {**os.environ, **NO_DISPLAY, "DISPLAY": f":{number}"}
        server.terminate()


class WindowCommand:
    """A running command with a window on the screen, and its output so far."""

    def __init__(self, screen: Environment, folder: Path, words: Sequence[str]) -> None:
        self._screen = screen
        self._out, self._err = folder / "out", folder / "err"
        with self._out.open("w") as out, self._err.open("w") as err:
            self.process = subprocess.Popen(words, env=screen, stdout=out, stderr=err)

    def __enter__(self) -> WindowCommand:
        return self

    def __exit__(self, *exception: object) -> None:
        self.process.kill()
        self.process.wait()

    @property
    def out(self) -> str:
        return self._out.read_text(encoding="utf-8")

    @property
    def err(self) -> str:
        return self._err.read_text(encoding="utf-8")

    def torque(self) -> str:
        """Returns the torque of the last complete line of a step."""
        steps = STEP.findall(self.out[: self.out.rfind("\n") + 1])
        return str(steps[-1][1]) if steps else "none"

    def wait_for_window(self) -> None:
        self.wait_for(lambda: self._xdotool("search", "--onlyvisible", "--pid", self.process.pid))

    def wait_for_torque(self, torque: str) -> None:
        self.wait_for(lambda: self.torque() == torque)

    def press(self, key: str) -> None:
        self._xdotool("key", key)

    def _xdotool(self, *words: object) -> bytes:
        command = ["xdotool", *map(str, words)]
        done = subprocess.run(command, env=self._screen, stdout=subprocess.PIPE, check=False)
        return done.stdout

    def wait_for(self, condition: Callable[[], object]) -> None:
        wait_for(lambda: condition() or self.process.poll() is not None)
        assert self.process.poll() is None, f"the command ended: {self.out[-500:]}{self.err}"


def test_keys_drive_the_pendulum_in_a_real_window(screen: Environment, tmp_path: Path) -> None:
    # With a policy, the process has TensorFlow, too.
    words = command_line("play", "--against", "reference", "--print-steps", "--seed", "5")
    with WindowCommand(screen, tmp_path, words) as game:
        game.wait_for_window()
        for key, torque in (("j", "-2"), ("l", "2"), ("k", "0"), ("Left", "2"), ("Right", "-2")):
            game.press(key)
            game.wait_for_torque(torque)
        game.press("r")
        game.press("Down")
        game.wait_for_torque("0")
        game.press("Escape")
        assert game.process.wait() == 0
    assert "error" not in game.err
    steps = STEP.findall(game.out)
    restart = [int(step[0]) for step in steps].index(1, 1)
    torques = [float(step[1]) for step in steps]
    for episode in (slice(0, restart), slice(restart, None)):
        rewards = [f"{reward:.3f}" for reward in gymnasium_rewards(torques[episode], seed=5)]
        assert [step[2] for step in steps[episode]] == rewards
    partial_return = float(steps[-1][3])
    last_line = game.out.splitlines()[-1]
    assert last_line == f"you {partial_return:.1f} after {steps[-1][0]} of 200 steps"


def test_control_c_ends_play(screen: Environment, tmp_path: Path) -> None:
    with WindowCommand(screen, tmp_path, command_line("play")) as game:
        game.wait_for_window()
        game.process.send_signal(signal.SIGINT)
        assert game.process.wait() == 130
    assert game.err == ""


def test_control_c_that_pygame_drops_ends_play_at_the_next_frame() -> None:
    class DroppingWindow:
        """A window that drops the exception of Ctrl-C in its second frame, as pygame may."""

        frames = 0

        def key_events(self) -> list[tuple[Key, bool]]:
            return []

        def show(self, game: object) -> None:
            self.frames += 1
            assert self.frames < 10, "the game does not end"
            if self.frames == 2:
                with contextlib.suppress(KeyboardInterrupt):
                    signal.raise_signal(signal.SIGINT)

    window: Any = DroppingWindow()
    game = Game(Pendulum(), 5)
    before = signal.getsignal(signal.SIGINT)
    # The test runner may have been started with Ctrl-C ignored.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    with control_c() as check_control_c, pytest.raises(KeyboardInterrupt):
        play(game, window, check_control_c)
    game.close()
    assert window.frames == 2
    assert signal.signal(signal.SIGINT, before) is signal.default_int_handler


@pytest.fixture
def closed_window(no_window: None) -> None:
    """The window that opens next is closed at once."""
    pygame.display.init()
    pygame.event.post(pygame.event.Event(pygame.QUIT))


def test_closing_the_window_ends_evaluation_in_one_line(
    closed_window: None, refusal: Refusal
) -> None:
    assert refusal(evaluate_command.main, ["reference", "--render"]) == CLOSED


@pytest.mark.parametrize("flag", ["--live", "--render"])
def test_closing_the_window_does_not_end_training(
    flag: str, closed_window: None, in_process: Command
) -> None:
    words = ["--preset", "cartpole-original", "--hidden-units", "8", "--episodes", "2", "--quiet"]
    done = in_process("train", flag, *words)
    assert (done.returncode, done.stderr) == (0, "")
    assert "Trained 2 episodes" in done.stdout
    assert flag == "--render" or not pygame.display.get_init()
