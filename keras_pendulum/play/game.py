"""The game: the player drives, then a policy drives from the same start.

A `Game` has no window and no clock. Its caller passes it the pressed keys, calls `advance` once per
frame, and draws it.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum, auto

from keras_pendulum.environments.task import Task
from keras_pendulum.evaluate.policy import Policy
from keras_pendulum.figures.moment import ShownEpisode, States
from keras_pendulum.figures.scenes import scene
from keras_pendulum.optimum.solution import USUAL_SEEDS
from keras_pendulum.optimum.solutions import solution
from keras_pendulum.play.controls import CONTROLS

FRAMES_PER_SECOND = 20  # each is a step: of 0.05 s for the pendulum
READY_FRAMES = 2 * FRAMES_PER_SECOND  # the player sees the start before anything moves


class Key(Enum):
    """The meaning of a key."""

    NEGATIVE = auto()  # effort
    POSITIVE = auto()
    LEFT = auto()  # moves to the left what is upright
    RIGHT = auto()
    NEUTRAL = auto()
    HOLD = auto()  # switches between keys that act until the next one, and while they are held
    RESTART = auto()
    CONTINUE = auto()
    LEAVE = auto()


class _Stage(Enum):
    """A stage of the game, with its title in the window and the keys that the window names."""

    READY = "You drive", "Press j, k, l or Enter to start, or wait 2 seconds"
    PLAYER = "You drive", "r  same start again     ESC  leave"
    AGENT = "The agent drives", "Enter  skip to the score     r  drive again     ESC  leave"
    SCORE = "The score", "r  same start again     Enter  next start     ESC  leave"


class Game:
    """A series of episodes of a task that ends when the player leaves.

    The player drives first. Then the agent, if any, drives from the same start. Then the game
    prints the score.

    The constructor takes some 20 s if the optimal return of the first start is not stored yet.

    Args:
        task: Pendulum-v1 or CartPole-v1.
        seed: of the first start.
        policy: drives after the player, if there is one.
        print_line: called with each line of output.
        print_steps: print a line for each step of the player.

    Attributes:
        task: that is played.
        controls: what its keys do.
        seed: of the present start.
        episode: on the screen.
        held: whether a key acts only while it is held.
        finished: whether the player has left.
    """

    def __init__(
        self,
        task: Task,
        seed: int,
        policy: Policy | None = None,
        *,
        print_line: Callable[[str], None] = print,
        print_steps: bool = False,
    ) -> None:
        self.task, self._policy, self._print_line = task, policy, print_line
        self._print_steps = print_steps
        self.controls, self._scene = CONTROLS[task.environment], scene(task)
        right = self._scene.dynamics.rightward
        self._directions = {Key.NEGATIVE: -1, Key.POSITIVE: 1, Key.NEUTRAL: 0}
        self._directions |= {Key.LEFT: -right, Key.RIGHT: right}
        self._env = task.make_env()
        self.finished = self.held = False
        self._stage = _Stage.READY
        self._start(seed)

    def press(self, key: Key) -> None:
        """Applies a key press."""
        stage = self._stage
        if key is Key.LEAVE:
            self._leave()
        elif key is Key.RESTART:
            self._restart()
        elif key is Key.HOLD:
            self.held = not self.held
            self._direction = 0
        elif key in self._directions and stage in (_Stage.READY, _Stage.PLAYER):
            self._direction = self._directions[key]
            self._stage = _Stage.PLAYER
        elif key is Key.CONTINUE and stage is _Stage.READY:
            self._stage = _Stage.PLAYER
        elif key is Key.CONTINUE and stage is _Stage.AGENT:
            while self._stage is _Stage.AGENT:
                self._step_agent()
        elif key is Key.CONTINUE and stage is _Stage.SCORE:
            # Stays within the seeds whose optimal returns are stored together.
            self._start((self.seed + 1) % len(USUAL_SEEDS))

    def release(self, key: Key) -> None:
        """Ends the effort of a key that is released, where keys act only while they are held."""
        if self.held and self._directions.get(key) == self._direction:
            self._direction = 0

    def advance(self) -> None:
        """Advances by one frame; the player or the agent takes one step."""
        if self._stage is _Stage.READY:
            self._frames_left -= 1
            if self._frames_left == 0:
                self._stage = _Stage.PLAYER
        elif self._stage is _Stage.PLAYER:
            self._step_player()
        elif self._stage is _Stage.AGENT:
            self._step_agent()

    @property
    def title(self) -> str:
        """Who drives."""
        return self._stage.value[0]

    @property
    def message(self) -> str:
        """The text over the picture; empty while an episode runs."""
        return {_Stage.READY: "Get ready!", _Stage.SCORE: self._score()}.get(self._stage, "")

    @property
    def key_help(self) -> str:
        """The keys of the present stage."""
        return self._stage.value[1]

    @property
    def earlier_path(self) -> States:
        """The path of the player while the agent drives."""
        return () if self.episode is self._player else self._player.path

    def close(self) -> None:
        """Closes the environment."""
        self._env.close()

    def _start(self, seed: int) -> None:
        self.seed = seed
        self._optimal_return = float(solution(self.task).best_returns([seed])[0])
        self._print_line(f"Start: seed {seed}, {self.task.name}")
        self._restart()

    def _restart(self) -> None:
        # The episode on the screen is the player's until the agent drives.
        self._player = self.episode = self._new_episode()
        self._direction = 0
        self._stage = _Stage.READY
        self._frames_left = READY_FRAMES

    def _new_episode(self) -> ShownEpisode:
        observation, _ = self._env.reset(seed=self.seed)
        return ShownEpisode(self._scene, self._env, observation, self._optimal_return)

    def _step_player(self) -> None:
        player, effort = self._player, self._scene.dynamics.effort
        player.step(self.controls.action(self._direction, player.steps))
        if self._print_steps:
            self._print_line(
                f"Step: {player.steps}, {effort.capitalize()}: {player.effort:g}, "
                f"Reward: {player.reward:.3f}, Return: {player.total_reward:.3f}"
            )
        if player.done:
            if self._policy is None:
                self._show_score()
            else:
                self._policy.reset()
                self.episode = self._new_episode()
                self._stage = _Stage.AGENT

    def _step_agent(self) -> None:
        assert self._policy is not None
        self.episode.step(self._policy.action(self.episode.observation))
        if self.episode.done:
            self._show_score()

    def _show_score(self) -> None:
        self._stage = _Stage.SCORE
        self._print_line(self._score())

    def _leave(self) -> None:
        if self._stage is not _Stage.SCORE:
            self._print_line(self._score())
        self.finished = True

    def _score(self) -> str:
        """Returns the returns of the finished episodes, or the player's return so far."""
        show = self._scene.show_return
        player = f"you {show(self._player.total_reward)}"
        if not self._player.done:
            steps = self.task.steps_per_episode
            return f"{player} after {self._player.steps} of {steps} steps"
        parts = [player]
        if self.episode is not self._player and self.episode.done:
            parts.append(f"agent {show(self.episode.total_reward)}")
        return " · ".join([*parts, f"best possible {show(self._optimal_return)}"])
