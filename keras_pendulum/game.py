"""The game of driving the pendulum by hand: keys make a torque, the torque a step, the step a view.

No window and no clock is known here: a `Game` is told which keys are pressed and when a frame has
passed, and says what there is to see.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, auto
from typing import Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.driving import Drive, Policy
from keras_pendulum.environment import STEPS_PER_EPISODE, make_environment
from keras_pendulum.optimum import USUAL_SEEDS, optimal_return
from keras_pendulum.torque import MAX_TORQUE

FRAMES_PER_SECOND = 20  # a step of the environment is 0.05 s
READY_FRAMES = 2 * FRAMES_PER_SECOND  # to look at the start before it moves


class Key(Enum):
    """What a key means to the game."""

    CLOCKWISE = auto()
    COUNTERCLOCKWISE = auto()
    NO_TORQUE = auto()
    RESTART = auto()
    ON = auto()
    LEAVE = auto()


TORQUES = {Key.CLOCKWISE: -MAX_TORQUE, Key.COUNTERCLOCKWISE: MAX_TORQUE, Key.NO_TORQUE: 0.0}  # N·m


@dataclass(frozen=True)
class View:
    """What there is to see."""

    title: str
    gravity: float  # m/s²
    seed: int
    torque: float  # N·m, acting now
    step: int
    reward: float  # of this step
    total: float  # the return so far
    best: float  # the best possible return
    message: str  # for all to read; empty while somebody drives
    hint: str  # which keys do what now
    pixels: NDArray[np.uint8]  # [500, 500, 3], Gymnasium's own picture


class _Scene(Enum):
    READY = auto()  # the start is shown
    PLAYER = auto()
    AGENT = auto()
    SCORE = auto()


_TITLES = {
    _Scene.READY: "You drive",
    _Scene.PLAYER: "You drive",
    _Scene.AGENT: "The agent drives",
    _Scene.SCORE: "The score",
}
_HINTS = {
    _Scene.READY: "Your first key starts, or it starts by itself",
    _Scene.PLAYER: "r  same start again     ESC  leave",
    _Scene.AGENT: "Enter  skip to the score     r  drive again     ESC  leave",
    _Scene.SCORE: "r  same start again     Enter  next start     ESC  leave",
}


class Game:
    """Episode after episode, until the player leaves.

    The player drives; then, where there is an agent, it drives from the same start; then the score
    is told. The best possible return of a first start that is not among the known ones takes some
    20 s, before the game is made.

    Args:
        gravity: m/s².
        seed: of the first start.
        agent: what drives after the player, or None.
        tell: takes the lines that are printed.
        print_steps: whether each of the player's steps is one of them.
    """

    def __init__(
        self,
        gravity: float,
        seed: int,
        agent: Policy | None = None,
        *,
        tell: Callable[[str], None] = print,
        print_steps: bool = False,
    ) -> None:
        self._gravity, self._agent, self._tell = gravity, agent, tell
        self._print_steps = print_steps
        self._env = make_environment("Pendulum-v1", gravity, render_mode="rgb_array")
        self.over = False
        self._scene = _Scene.READY
        self._start(seed)

    def press(self, key: Key) -> None:
        """A key goes down."""
        scene = self._scene
        if key is Key.LEAVE:
            self._leave()
        elif key is Key.RESTART:
            self._restart()
        elif key in TORQUES and scene in (_Scene.READY, _Scene.PLAYER):
            self._torque = TORQUES[key]
            self._scene = _Scene.PLAYER
        elif key is Key.ON and scene is _Scene.READY:
            self._scene = _Scene.PLAYER
        elif key is Key.ON and scene is _Scene.AGENT:
            while self._scene is _Scene.AGENT:
                self._step_agent()
        elif key is Key.ON and scene is _Scene.SCORE:
            # After the last start whose best possible return is known at once comes the first.
            self._start((self._seed + 1) % len(USUAL_SEEDS))

    def advance(self) -> None:
        """A frame passes: whoever drives makes a step."""
        if self._scene is _Scene.READY:
            self._frames_left -= 1
            if self._frames_left == 0:
                self._scene = _Scene.PLAYER
        elif self._scene is _Scene.PLAYER:
            self._step_player()
        elif self._scene is _Scene.AGENT:
            self._step_agent()

    def view(self) -> View:
        """What there is to see now."""
        message = {_Scene.READY: "Get ready!", _Scene.SCORE: self._score()}.get(self._scene, "")
        pixels: Any = self._env.render()
        drive = self._drive
        return View(
            title=_TITLES[self._scene],
            gravity=self._gravity,
            seed=self._seed,
            torque=drive.torque,
            step=drive.steps,
            reward=drive.reward,
            total=drive.total,
            best=self._best,
            message=message,
            hint=_HINTS[self._scene],
            pixels=pixels,
        )

    def close(self) -> None:
        """Frees what Gymnasium draws with; pygame's windows go with it."""
        self._env.close()

    def _start(self, seed: int) -> None:
        self._seed = seed
        self._best = float(optimal_return(self._gravity, [seed])[0])
        self._tell(f"Start: seed {seed}, g = {self._gravity:g}")
        self._restart()

    def _restart(self) -> None:
        self._player = self._drive = Drive(self._env, self._seed)
        self._torque = 0.0
        self._scene = _Scene.READY
        self._frames_left = READY_FRAMES

    def _step_player(self) -> None:
        self._player.step(self._torque)
        if self._print_steps:
            self._tell(str(self._player))
        if self._player.over:
            if self._agent is None:
                self._finish()
            else:
                self._drive = Drive(self._env, self._seed)
                self._scene = _Scene.AGENT

    def _step_agent(self) -> None:
        assert self._agent is not None
        self._drive.step(self._agent(self._drive.observation))
        if self._drive.over:
            self._finish()

    def _finish(self) -> None:
        self._scene = _Scene.SCORE
        self._tell(self._score())

    def _leave(self) -> None:
        if self._scene is not _Scene.SCORE:
            self._tell(self._score())
        self.over = True

    def _score(self) -> str:
        """The returns of those who are at the end, or how far the player has come."""
        you = f"you {self._player.total:.1f}"
        if not self._player.over:
            return f"{you} after {self._player.steps} of {STEPS_PER_EPISODE} steps"
        agent = self._drive is not self._player and self._drive.over
        figures = [you, *([f"agent {self._drive.total:.1f}"] if agent else [])]
        return " · ".join([*figures, f"best possible {self._best:.1f}"])
