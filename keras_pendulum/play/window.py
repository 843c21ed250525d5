"""The window of the game: it reads keys, and Ctrl-C, and draws frames."""

from __future__ import annotations

import functools
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pygame

from keras_pendulum.errors import UserError
from keras_pendulum.figures.drawing import LARGE, PAPER, Writer
from keras_pendulum.figures.moment import BELOW, draw_moment
from keras_pendulum.play.game import FRAMES_PER_SECOND, Game, Key

KEYS = {
    pygame.K_j: Key.NEGATIVE,
    pygame.K_LEFT: Key.LEFT,
    pygame.K_l: Key.POSITIVE,
    pygame.K_RIGHT: Key.RIGHT,
    pygame.K_k: Key.NEUTRAL,
    pygame.K_DOWN: Key.NEUTRAL,
    pygame.K_UP: Key.NEUTRAL,
    pygame.K_h: Key.HOLD,
    pygame.K_r: Key.RESTART,
    pygame.K_RETURN: Key.CONTINUE,
    pygame.K_KP_ENTER: Key.CONTINUE,
    pygame.K_SPACE: Key.CONTINUE,
    pygame.K_ESCAPE: Key.LEAVE,
}

_SIZE = _WIDTH, _HEIGHT = 1000, 640
_TOP = 48  # height of the title
_MOMENT = pygame.Rect(0, _TOP, _WIDTH, 456 + BELOW)


class Window:
    """A window on the screen.

    Args:
        wait_for_frame: waits until the next frame is due; the default is 20 frames per second.

    Raises UserError when the window cannot be opened.
    """

    def __init__(self, wait_for_frame: Callable[[], object] | None = None) -> None:
        self._wait_for_frame = wait_for_frame or functools.partial(
            pygame.time.Clock().tick, FRAMES_PER_SECOND
        )
        try:
            pygame.display.init()
            self._screen = pygame.display.set_mode(_SIZE)
        except pygame.error as error:
            raise UserError(f"cannot open a window: {error}") from error
        pygame.display.set_caption("keras_pendulum: play")
        pygame.key.stop_text_input()  # an input method would take the letters
        self._writer = Writer(self._screen)
        self._write = self._writer.write

    def key_events(self) -> list[tuple[Key, bool]]:
        """Returns the keys since the last call, and whether they were pressed or released.

        A closed window counts as LEAVE.
        """
        events = []
        for event in pygame.event.get():
            if event.type == pygame.QUIT:
                events.append((Key.LEAVE, True))
            elif event.type in (pygame.KEYDOWN, pygame.KEYUP) and event.key in KEYS:
                events.append((KEYS[event.key], event.type == pygame.KEYDOWN))
        return events

    def show_loading(self, text: str) -> None:
        """Draws a line of text."""
        self._screen.fill(PAPER)
        self._write(text, (_WIDTH // 2, _HEIGHT // 2 - 12), LARGE, align=0.5)
        pygame.event.pump()
        pygame.display.flip()

    def close(self) -> None:
        """Closes the window."""
        pygame.display.quit()

    def show(self, game: Game) -> None:
        """Draws a frame of the game and waits until the next one is due."""
        self._screen.fill(PAPER)
        self._write(game.title, (16, 13), LARGE)
        acts = "while it is held" if game.held else "until the next one"
        self._write(f"a key acts {acts} (h: switch)", (_WIDTH // 2 - 90, 16), align=0.5)
        setting = game.controls.setting.format(gravity=game.task.gravity)
        start = f"{setting}      start of seed {game.seed}"
        self._write(start, (_WIDTH - 16, 16), align=1.0)
        draw_moment(self._writer, _MOMENT, game.episode, game.earlier_path)
        if game.message:
            self._write(game.message, (_WIDTH // 4, _TOP + 6), align=0.5)
        self._write(game.controls.keys, (16, _HEIGHT - 30))
        self._write(game.key_help, (_WIDTH - 16, _HEIGHT - 30), align=1.0)
        pygame.display.flip()
        self._wait_for_frame()


def play(game: Game, window: Window, check_interrupt: Callable[[], None]) -> None:
    """Runs the game in the window until the player leaves.

    `check_interrupt` is called before each frame; it may raise to end the game.
    """
    while True:
        check_interrupt()
        for key, pressed in window.key_events():
            (game.press if pressed else game.release)(key)
            if game.finished:
                return
        game.advance()
        window.show(game)


@contextmanager
def control_c() -> Iterator[Callable[[], None]]:
    """Yields a function that raises KeyboardInterrupt if Ctrl-C was pressed in the `with` block.

    Ctrl-C raises it at once, too, but the C code of pygame may drop the exception.
    """
    pressed = False

    def check() -> None:
        if pressed:
            raise KeyboardInterrupt

    def on_signal(number: int, frame: object) -> None:
        nonlocal pressed
        pressed = True
        check()

    before = signal.getsignal(signal.SIGINT)
    # A process that ignores Ctrl-C, or has its own handler, stays as it is.
    if before is signal.default_int_handler:
        signal.signal(signal.SIGINT, on_signal)
    try:
        yield check
    finally:
        signal.signal(signal.SIGINT, before)
