"""Driving by hand: without a screen, and in a real window with keys sent to it."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pygame
import pytest
from conftest import Command, Refusal, command_line

import keras_pendulum as kp
from keras_pendulum import cockpit, evaluate, play
from keras_pendulum.command_line import ControlC
from keras_pendulum.driving import Drive, Policy
from keras_pendulum.environment import STEPS_PER_EPISODE, make_environment
from keras_pendulum.game import READY_FRAMES, Game, Key
from keras_pendulum.lost_window import LossGuard

NO_SCREEN = {"DISPLAY": "", "WAYLAND_DISPLAY": "", "SDL_VIDEODRIVER": ""}
CLOSED = "error: the window was closed before the last episode was over\n"
STEP = re.compile(r"Step: (\d+), Torque: (\S+), Reward: (\S+), Return: (\S+)")


@dataclass
class Player:
    """Stands for the clock: at its frames' ends presses keys, and then looks at the window."""

    keys: Mapping[int, Any]  # frame -> pygame's keys, or an event's type
    lines: list[str] = field(default_factory=list)
    frames: int = 0
    looks: dict[int, Any] = field(default_factory=dict)  # frame -> the window's pixels

    def tick(self) -> None:
        self.frames += 1
        assert self.frames < 5000, "the game does not end"
        if self.frames in self.keys:
            surface = pygame.display.get_surface()
            assert surface is not None
            self.looks[self.frames] = pygame.surfarray.array3d(surface)
            for key in np.atleast_1d(self.keys[self.frames]).tolist():
                if key == pygame.QUIT:
                    pygame.event.post(pygame.event.Event(pygame.QUIT))
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


def played(keys: Mapping[int, Any], **settings: Any) -> Player:
    """A whole game: at the end of frame i the keys `keys[i]` are pressed."""
    player = Player(keys)
    game = Game(
        **{"gravity": 1.0, "seed": 3, "print_steps": True} | settings, tell=player.lines.append
    )
    window = cockpit.Window(LossGuard(), player.tick)
    cockpit.play(game, window, lambda: None)
    game.close()
    return player


def gymnasium_rewards(torques: list[float], seed: int, gravity: float = 1.0) -> list[float]:
    env = make_environment("Pendulum-v1", gravity)
    env.reset(seed=seed)
    return [float(env.step(np.array([torque]))[1]) for torque in torques]


@pytest.mark.parametrize(
    ("key", "torque"),
    [
        ("j", -2),
        ("l", 2),
        ("k", 0),
        ("LEFT", -2),
        ("RIGHT", 2),
        ("DOWN", 0),
        ("UP", 0),
    ],
)
def test_a_key_starts_and_its_torque_stays(key: str, torque: float, no_window: None) -> None:
    other = pygame.K_j if torque == 2 else pygame.K_l
    player = played({1: other, 4: getattr(pygame, f"K_{key}"), 12: pygame.K_ESCAPE})
    assert player.torques == [-2 if other == pygame.K_j else 2] * 3 + [torque] * 8


def test_without_a_key_it_starts_by_itself_and_without_a_torque(no_window: None) -> None:
    player = played({READY_FRAMES + 5: pygame.K_ESCAPE})
    assert player.torques == [0] * 5


def test_the_score_is_the_sum_of_gymnasiums_rewards(no_window: None) -> None:
    keys = {1: pygame.K_l, 30: pygame.K_j, 55: pygame.K_k, 80: pygame.K_RIGHT, 100: pygame.K_LEFT}
    player = played({**keys, 240: pygame.K_ESCAPE}, seed=7, gravity=10.0)
    assert len(player.torques) == STEPS_PER_EPISODE
    assert set(player.torques) == {-2, 0, 2}
    rewards = gymnasium_rewards(player.torques, seed=7, gravity=10.0)
    assert player.rewards == [round(reward, 3) for reward in rewards]
    best = kp.optimal_return(10.0, [7])[0]
    assert player.scores == [f"you {sum(rewards):.1f} · best possible {best:.1f}"]
    assert player.lines[0] == "Start: seed 7, g = 10"
    assert player.lines[-1] == player.scores[0]  # leaving after the score tells nothing more


def test_steps_are_printed_only_if_wanted(no_window: None) -> None:
    player = played({1: pygame.K_l, 11: pygame.K_ESCAPE}, print_steps=False)
    so_far = sum(gymnasium_rewards([2] * 10, seed=3))
    assert player.lines == ["Start: seed 3, g = 1", f"you {so_far:.1f} after 10 of 200 steps"]


def test_r_restarts_the_same_start_without_a_torque(no_window: None) -> None:
    player = played({1: pygame.K_l, 21: pygame.K_r, 21 + READY_FRAMES + 3: pygame.K_ESCAPE})
    assert player.torques == [2] * 20 + [0] * 3
    assert player.rewards[20:] == [round(r, 3) for r in gymnasium_rewards([0] * 3, seed=3)]
    assert player.scores == [f"you {sum(player.rewards[20:]):.1f} after 3 of 200 steps"]


@pytest.mark.parametrize("end", [pygame.K_ESCAPE, pygame.QUIT], ids=["ESC", "closed"])
def test_leaving_tells_the_score_so_far_and_makes_no_further_step(
    end: int, no_window: None
) -> None:
    player = played({1: pygame.K_j, 11: [end, pygame.K_ESCAPE]})
    so_far = sum(gymnasium_rewards([-2] * 10, seed=3))
    assert player.frames == 11
    assert player.scores == [f"you {so_far:.1f} after 10 of 200 steps"]


def test_after_the_score_r_plays_the_same_start_and_enter_the_next(no_window: None) -> None:
    over = 1 + STEPS_PER_EPISODE
    player = played(
        {
            1: pygame.K_l,
            over + 2: pygame.K_j,  # who still steers does not lose sight of the score
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
    # 999 is the last of those whose best possible returns are always known.
    assert [line for line in player.lines if "seed" in line] == [
        "Start: seed 999, g = 1",
        "Start: seed 0, g = 1",
    ]
    assert player.rewards[-3:] == [round(r, 3) for r in gymnasium_rewards([2] * 3, seed=0)]


def test_the_window_shows_what_happens(no_window: None) -> None:
    player = played({1: pygame.K_l, 10: pygame.K_j, 20: pygame.K_j, 21: pygame.K_ESCAPE})
    assert player.looks[1].shape == (600, 700, 3)
    bar = cockpit._BAR
    right, left = (bar.centerx + 50, bar.centery), (bar.centerx - 50, bar.centery)
    colours = [[tuple(look[place]) for place in (left, right)] for look in player.looks.values()]
    empty, blue, red = cockpit._WHITE, cockpit._CLOCKWISE, cockpit._COUNTERCLOCKWISE
    assert colours == [[empty, empty], [empty, red], [blue, empty], [blue, empty]]
    for band in ((0, 40), (60, 540), (600, 650)):  # the pendulum and the figures; not the title
        rows = slice(*band)
        moved = (player.looks[20][:, rows] != player.looks[21][:, rows]).any()
        assert moved == (band[0] > 0)


def test_a_strip_along_the_lower_edge_grows_with_the_episode(no_window: None) -> None:
    player = played({1: pygame.K_l, 101: pygame.K_j, 201: pygame.K_ESCAPE})
    row = cockpit._TOP + cockpit._SIDE - 2
    strips = [(look[:, row] == cockpit._LINE).all(axis=-1) for look in player.looks.values()]
    assert [int(strip.sum()) for strip in strips] == [0, 300, 600]
    assert strips[1][:300].all()


@pytest.mark.parametrize("torque", [float("nan"), float("inf"), -2.001, 40.0])
def test_a_torque_that_no_pendulum_takes_never_reaches_it(torque: float) -> None:
    class Untouchable:
        def reset(self, seed: int) -> tuple[None, None]:
            return None, None

    drive = Drive(Untouchable(), seed=0)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="expected a number from -2 to 2"):
        drive.step(torque)


@pytest.fixture(scope="module")
def agent() -> Policy:
    return play._load_agent("reference")[0]


def test_the_agent_drives_the_same_start_and_three_returns_are_told(
    agent: Policy, no_window: None
) -> None:
    over = 1 + 2 * STEPS_PER_EPISODE
    player = played({1: pygame.K_l, over + 10: pygame.K_ESCAPE}, seed=11, agent=agent)
    you = sum(gymnasium_rewards([2] * STEPS_PER_EPISODE, seed=11))
    score = kp.evaluate_policy(kp.load_weights(kp.find_weights("reference")), 1, seed=11)
    assert player.scores == [
        f"you {you:.1f} · agent {score.mean_return:.1f} · "
        f"best possible {score.optimal_mean_return:.1f}"
    ]
    assert len(player.torques) == STEPS_PER_EPISODE  # the player's steps alone are printed


@pytest.mark.parametrize("key", [pygame.K_SPACE, pygame.K_RETURN], ids=["space", "enter"])
def test_a_key_skips_to_the_agents_score(key: int, agent: Policy, no_window: None) -> None:
    over = 1 + STEPS_PER_EPISODE
    player = played({1: pygame.K_l, over + 5: key, over + 7: pygame.K_ESCAPE}, agent=agent)
    score = kp.evaluate_policy(kp.load_weights(kp.find_weights("reference")), 1, seed=3)
    assert f"agent {score.mean_return:.1f} · best" in player.scores[0]
    assert player.frames == over + 7


def test_who_leaves_while_the_agent_drives_has_a_score(agent: Policy, no_window: None) -> None:
    over = 1 + STEPS_PER_EPISODE
    player = played({1: pygame.K_l, over + 5: pygame.K_ESCAPE}, agent=agent)
    you = sum(gymnasium_rewards([2] * STEPS_PER_EPISODE, seed=3))
    best = kp.optimal_return(1.0, [3])[0]
    assert player.scores == [f"you {you:.1f} · best possible {best:.1f}"]


@pytest.fixture
def typed(monkeypatch: pytest.MonkeyPatch, no_window: None) -> dict[str, Any]:
    """What the command hands on when it has read its flags."""
    handed: dict[str, Any] = {}

    def drive(
        guard: LossGuard, gravity: float, seed: int | None, agent: Any, print_steps: bool
    ) -> int:
        handed.update(gravity=gravity, seed=seed, agent=agent, print_steps=print_steps)
        return 0

    monkeypatch.setattr(play, "_drive", drive)
    return handed


@pytest.mark.parametrize(
    ("words", "gravity"),
    [
        ([], 1.0),
        (["--gravity", "3"], 3.0),
        (["--against", "reference"], 1.0),
        (["--against", "swingup"], 10.0),
        (["--against", "swingup", "--gravity", "0"], 0.0),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_the_gravity_is_the_typed_one_or_the_files_or_1(
    words: list[str], gravity: float, typed: dict[str, Any]
) -> None:
    assert play.main(words) == 0
    assert typed["gravity"] == gravity
    assert (typed["agent"] is not None) == ("--against" in words)


def test_it_starts_without_tensorflow_and_its_help_without_anything() -> None:
    code = (
        "import runpy, sys\n"
        "sys.argv = ['play', *{words}]\n"
        "try:\n"
        "    runpy.run_module('keras_pendulum.play', run_name='__main__')\n"
        "except SystemExit as exit:\n"
        "    assert exit.code == 0\n"
        "assert not {heavy} & set(sys.modules), {heavy} & set(sys.modules)\n"
    )
    heavy = {"tensorflow", "keras", "h5py", "matplotlib"}
    drives = (
        "import threading, pygame\n"
        "def leave():\n"
        "    pygame.event.post(pygame.event.Event(pygame.QUIT))\n"
        "threading.Timer(1.5, leave).start()\n"
    )
    for words, loaded, before in (
        (["--help"], heavy | {"numpy", "gymnasium", "pygame"}, ""),
        (["--seed", "4"], heavy, drives),
    ):
        done = subprocess.run(
            [sys.executable, "-c", before + code.format(words=words, heavy=loaded)],
            capture_output=True,
            text=True,
            check=False,
            timeout=60,
            env={**os.environ, "SDL_VIDEODRIVER": "dummy"},
        )
        assert (done.returncode, done.stderr) == (0, "")
    assert "Start: seed 4, g = 1\nyou " in done.stdout


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--against", "missing.h5"], "missing.h5: no such file"),
        (["--against", "text.h5"], "text.h5: not an HDF5 file"),
        (["--against", "cartpole"], "cartpole.h5: belongs to CartPole-v1; expected Pendulum-v1"),
        (["--against", ""], "the name is empty"),
        (["--gravity", "nan", "--against", "missing.h5"], "gravity is nan"),
        (["--gravity", "101"], "gravity is 101"),
        (["--seed", "-1", "--against", "missing.h5"], "seed is -1"),
        (["--seed", "one"], "invalid int value: 'one'"),
        (["--faster"], "unrecognized arguments: --faster"),
    ],
    ids=lambda value: str(value)[:40],
)
def test_a_mistake_is_told_in_one_line_before_there_is_a_window(
    words: list[str], message: str, no_window: None, refusal: Refusal
) -> None:
    assert message in refusal(play.main, words)
    assert not pygame.display.get_init() or pygame.display.get_surface() is None


@pytest.mark.parametrize("display", ["", ":9999"], ids=["none", "a wrong one"])
def test_no_display_is_told_in_one_line(display: str, command: Command) -> None:
    done = command("play", "--seed", "1", environment={**NO_SCREEN, "DISPLAY": display})
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "error: there is no display to open a window on\n"


class Screen:
    """An X server of its own, with no more on it than what a test starts there."""

    def __init__(self) -> None:
        reading, writing = os.pipe()
        self._server = subprocess.Popen(
            # Without -noreset it starts anew after each client that was the only one, and refuses
            # those who come meanwhile.
            ["Xvfb", "-displayfd", str(writing), "-screen", "0", "800x800x24", "-noreset"],
            pass_fds=[writing],
            stderr=subprocess.DEVNULL,
        )
        os.close(writing)
        with os.fdopen(reading) as pipe:  # it chooses a free number, and writes when it is ready
            number = pipe.readline().strip()
        here = {"DISPLAY": f":{number}", "PYTHONUNBUFFERED": ""}
        self.environment = {**os.environ, **NO_SCREEN, **here}

    def xdotool(self, *words: str) -> str:
        return subprocess.run(
            ["xdotool", *words],
            env=self.environment,
            capture_output=True,
            text=True,
            check=False,
            timeout=20,
        ).stdout.strip()

    def stop(self) -> None:
        self._server.terminate()
        self._server.wait()


@pytest.fixture
def screen() -> Iterator[Screen]:
    missing = [name for name in ("Xvfb", "xdotool") if shutil.which(name) is None]
    if missing:
        reason = f"no real window without {' and '.join(missing)} (packages xvfb and xdotool)"
        if os.environ.get("CI"):
            pytest.fail(reason, pytrace=False)
        pytest.skip(reason)
    screen = Screen()
    yield screen
    screen.stop()


class Playing:
    """The command in a window of the screen, and what it has printed so far."""

    command: tuple[str, ...] = ("play", "--print-steps")

    def __init__(self, screen: Screen, folder: Path, *words: str) -> None:
        self.screen = screen
        self._out, self._err = folder / "out", folder / "err"
        with self._out.open("w") as out, self._err.open("w") as err:
            self.process = subprocess.Popen(
                command_line(*self.command, *words),
                env=screen.environment,
                stdout=out,
                stderr=err,
            )

    def __enter__(self) -> Playing:
        return self

    def __exit__(self, *failure: object) -> None:
        self.process.kill()
        self.process.wait()

    @property
    def out(self) -> str:
        return self._out.read_text(encoding="utf-8")

    @property
    def err(self) -> str:
        return self._err.read_text(encoding="utf-8")

    def torque(self) -> str:
        """Of the last step that is printed whole."""
        steps = STEP.findall(self.out[: self.out.rfind("\n") + 1])
        return str(steps[-1][1]) if steps else "none"

    def window(self) -> str:
        words = "search", "--onlyvisible", "--pid", str(self.process.pid)
        return str(self.wait_for(lambda: self.screen.xdotool(*words)))

    def press(self, key: str) -> None:
        self.screen.xdotool("key", key)

    def wait_for(self, found: Any) -> Any:
        until = time.monotonic() + 20
        while time.monotonic() < until and self.process.poll() is None:
            if value := found():
                return value
            time.sleep(0.05)
        return pytest.fail(f"nothing came: {self.out[-500:]}{self.err}", pytrace=False)

    def end(self) -> int:
        return self.process.wait(timeout=20)


def test_in_a_real_window_keys_drive_the_pendulum(screen: Screen, tmp_path: Path) -> None:
    with Playing(screen, tmp_path, "--seed", "5") as game:
        game.window()
        for key, torque in (("j", "-2"), ("l", "2"), ("k", "0"), ("Left", "-2"), ("Right", "2")):
            game.press(key)
            game.wait_for(lambda torque=torque: game.torque() == torque)
        game.press("r")
        game.press("Down")
        game.wait_for(lambda: game.torque() == "0")
        game.press("Escape")
        assert game.end() == 0
    assert game.err == ""
    steps = STEP.findall(game.out)
    restart = [int(step[0]) for step in steps].index(1, 1)
    torques = [float(step[1]) for step in steps]
    for drive in (slice(0, restart), slice(restart, None)):
        rewards = [f"{reward:.3f}" for reward in gymnasium_rewards(torques[drive], seed=5)]
        assert [step[2] for step in steps[drive]] == rewards
    so_far = float(steps[-1][3])
    assert game.out.splitlines()[-1] == f"you {so_far:.1f} after {steps[-1][0]} of 200 steps"


def test_beside_tensorflow_a_window_opens_and_a_destroyed_one_is_closed(
    screen: Screen, tmp_path: Path
) -> None:
    with Playing(screen, tmp_path, "--against", "reference", "--seed", "5") as game:
        game.window()
        game.press("l")
        game.wait_for(lambda: game.torque() == "2")
        screen.xdotool("windowclose", game.window())
        assert game.end() == 0
    assert "error" not in game.err
    assert re.search(r"\nyou \S+ after \d+ of 200 steps\n$", game.out)


def test_a_display_that_goes_away_is_told_in_one_line(screen: Screen, tmp_path: Path) -> None:
    with Playing(screen, tmp_path, "--seed", "5") as game:
        game.window()
        game.press("l")
        game.wait_for(lambda: game.torque() == "2")
        screen.stop()
        assert game.end() == 2
    assert game.err == "error: the connection to the display is lost\n"
    assert re.search(r"\nyou \S+ after \d+ of 200 steps\n$", game.out)


def test_control_c_ends_it(screen: Screen, tmp_path: Path) -> None:
    with Playing(screen, tmp_path) as game:
        game.window()
        game.process.send_signal(signal.SIGINT)
        assert game.end() == 130
    assert game.err == ""


def test_a_control_c_that_was_dropped_on_its_way_ends_it_at_the_next_frame() -> None:
    class Unseen:
        """A window that drops what comes while it shows the second frame, as pygame may."""

        shown = 0

        def pressed(self) -> list[Key]:
            return []

        def show(self, view: object) -> None:
            self.shown += 1
            assert self.shown < 10, "the game does not end"
            if self.shown == 2:
                with contextlib.suppress(KeyboardInterrupt):
                    signal.raise_signal(signal.SIGINT)

    window: Any = Unseen()
    game = Game(1.0, 5)
    before = signal.getsignal(signal.SIGINT)
    # As in a program that was not started with Ctrl-C ignored.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    with ControlC() as control_c, pytest.raises(KeyboardInterrupt):
        cockpit.play(game, window, control_c.check)
    game.close()
    assert window.shown == 2
    assert signal.signal(signal.SIGINT, before) is signal.default_int_handler


class Watching(Playing):
    """Another command with a window; its words begin with its name."""

    command = ()


def test_a_destroyed_window_ends_an_evaluation_in_one_line(screen: Screen, tmp_path: Path) -> None:
    with Watching(screen, tmp_path, "evaluate", "reference", "--render") as film:
        screen.xdotool("windowclose", film.window())
        assert film.end() == 2
    assert film.out == ""
    assert film.err.endswith(CLOSED)
    assert "X Error" not in film.err


@pytest.mark.parametrize("flag", ["--live", "--render"])
def test_a_destroyed_window_does_not_end_a_training(
    flag: str, screen: Screen, tmp_path: Path
) -> None:
    episodes = "60" if flag == "--live" else "1"
    words = ["train", flag, "--quiet", "--episodes", episodes, "--out", str(tmp_path / "run")]
    with Watching(screen, tmp_path, *words) as training:
        screen.xdotool("windowclose", training.window())
        assert training.end() == 0
    assert "X Error" not in training.err
    assert f"Trained {episodes} episodes" in training.out


def test_closing_the_window_ends_an_evaluation_in_one_line(
    no_window: None, refusal: Refusal
) -> None:
    pygame.display.init()
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    assert refusal(evaluate.main, ["reference", "--render"]) == CLOSED
