"""The window of the game: it reads keys and draws views."""

from __future__ import annotations

import functools
from collections.abc import Callable

import pygame

from keras_pendulum.environments.actions import MAX_TORQUE
from keras_pendulum.environments.tasks import STEPS_PER_EPISODE
from keras_pendulum.errors import UserError
from keras_pendulum.play.game import FRAMES_PER_SECOND, Game, Key, View

KEYS = {
    pygame.K_j: Key.CLOCKWISE,
    pygame.K_LEFT: Key.CLOCKWISE,
    pygame.K_l: Key.COUNTERCLOCKWISE,
    pygame.K_RIGHT: Key.COUNTERCLOCKWISE,
    pygame.K_k: Key.NO_TORQUE,
    pygame.K_DOWN: Key.NO_TORQUE,
    pygame.K_UP: Key.NO_TORQUE,
    pygame.K_r: Key.RESTART,
    pygame.K_RETURN: Key.CONTINUE,
    pygame.K_KP_ENTER: Key.CONTINUE,
    pygame.K_SPACE: Key.CONTINUE,
    pygame.K_ESCAPE: Key.LEAVE,
}

_SIZE = _WIDTH, _HEIGHT = 600, 700
_MIDDLE = pygame.Rect(70, 70, 360, 360)  # of Gymnasium's picture; the margin is always empty
_SIDE = 500  # of the middle, enlarged
_TOP = 44  # height of the title
_BAR = pygame.Rect(190, _TOP + _SIDE + 14, 220, 20)  # the torque

_INK, _PALE_INK, _PAPER = (25, 25, 25), (90, 90, 90), (236, 238, 241)
_WHITE, _LINE = (255, 255, 255), (175, 180, 186)
# Distinct for colour-blind people too (Okabe & Ito 2008).
_CLOCKWISE, _COUNTERCLOCKWISE = (0, 114, 178), (213, 94, 0)


class Window:
    """A window on the screen.

    Args:
        wait_for_frame: waits until the next frame is due; the default is 20 frames per second, the
            speed of the pendulum.

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
        pygame.font.init()
        self._small, self._large = pygame.font.Font(None, 48), pygame.font.Font(None, 64)

    def pressed_keys(self) -> list[Key]:
        """Returns the keys pressed since the last call; a closed window counts as LEAVE."""
        keys = []
        for event in pygame.event.get():
            if event.type == pygame.QUIT:
                keys.append(Key.LEAVE)
            elif event.type == pygame.KEYDOWN and event.key in KEYS:
                keys.append(KEYS[event.key])
        return keys

    def show(self, view: View) -> None:
        """Draws a view and waits until the next frame is due."""
        self._screen.fill(_PAPER)
        self._write(view.title, (14, 11), self._large)
        start = f"g = {view.gravity:g} m/s²     seed {view.seed}"
        self._write(start, (_WIDTH - 14, 15), align=1.0)
        self._draw_pendulum(view)
        self._draw_torque(view.torque)
        self._draw_numbers(view)
        self._write(
            "j or Left  -2 N·m     k or Down  0     l or Right  +2 N·m",
            (_WIDTH // 2, _HEIGHT - 52),
            align=0.5,
        )
        self._write(view.key_help, (_WIDTH // 2, _HEIGHT - 27), align=0.5)
        pygame.display.flip()
        self._wait_for_frame()

    def _draw_pendulum(self, view: View) -> None:
        picture = pygame.surfarray.make_surface(view.pixels.swapaxes(0, 1))
        picture = pygame.transform.smoothscale(picture.subsurface(_MIDDLE), (_SIDE, _SIDE))
        pygame.draw.rect(self._screen, _WHITE, (0, _TOP, _WIDTH, _SIDE))
        self._screen.blit(picture, ((_WIDTH - _SIDE) // 2, _TOP))
        # A strip along the lower edge shows the elapsed share of the episode.
        width = _WIDTH * view.step // STEPS_PER_EPISODE
        pygame.draw.rect(self._screen, _LINE, (0, _TOP + _SIDE - 4, width, 4))
        if view.message:
            self._write(view.message, (_WIDTH // 2, _TOP + 24), self._large, align=0.5)

    def _draw_torque(self, torque: float) -> None:
        """Draws a bar from the middle; a counterclockwise torque points to the right."""
        pygame.draw.rect(self._screen, _WHITE, _BAR)
        length = round(abs(torque) / MAX_TORQUE * _BAR.width / 2)
        left = _BAR.centerx - (length if torque < 0 else 0)
        colour = _CLOCKWISE if torque < 0 else _COUNTERCLOCKWISE
        pygame.draw.rect(self._screen, colour, (left, _BAR.top, length, _BAR.height))
        pygame.draw.rect(self._screen, _LINE, _BAR, width=1)
        pygame.draw.line(self._screen, _INK, _BAR.midtop, _BAR.midbottom, width=2)
        self._write("clockwise", (_BAR.left - 10, _BAR.top + 2), align=1.0, colour=_CLOCKWISE)
        self._write("counterclockwise", (_BAR.right + 10, _BAR.top + 2), colour=_COUNTERCLOCKWISE)

    def _draw_numbers(self, view: View) -> None:
        numbers = {
            "torque": f"{view.torque:+.1f} N·m" if view.torque else "0 N·m",
            "step": f"{view.step} of {STEPS_PER_EPISODE}",
            "reward": f"{view.reward:.3f}",
            "return": f"{view.total_reward:.1f}",
            "best possible": f"{view.optimal_return:.1f}",
        }
        width = _WIDTH / len(numbers)
        for i, (name, text) in enumerate(numbers.items()):
            middle = round((i + 0.5) * width)
            self._write(name, (middle, _BAR.bottom + 14), align=0.5, colour=_PALE_INK)
            self._write(text, (middle, _BAR.bottom + 33), self._large, align=0.5)

    def _write(
        self,
        text: str,
        place: tuple[int, int],
        font: pygame.font.Font | None = None,
        *,
        align: float = 0.0,
        colour: tuple[int, int, int] = _INK,
    ) -> None:
        """Writes text below `place`; `align` is the share of its width to the left of `place`."""
        # Scaled from double size, because pygame places letters at whole pixels, unevenly.
        drawn = pygame.transform.smoothscale_by(
            (font or self._small).render(text, True, colour), 0.5
        )
        self._screen.blit(drawn, (place[0] - round(align * drawn.get_width()), place[1]))


def play(game: Game, window: Window, check_interrupt: Callable[[], None]) -> None:
    """Runs the game in the window until the player leaves.

    `check_interrupt` is called before each frame; it may raise to end the game.
    """
    while True:
        check_interrupt()
        for key in window.pressed_keys():
            game.press(key)
            if game.finished:
                return
        game.advance()
        window.show(game.view())
