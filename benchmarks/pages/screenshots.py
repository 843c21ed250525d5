"""The pictures of the page and of the game in docs/.

    python -m benchmarks.pages.screenshots

Writes docs/page.png and docs/cartpole_page.png with a browser without a screen, and docs/play.png.
It needs Chromium and its chromedriver, and takes a minute.
"""

from __future__ import annotations

import os

from benchmarks.pages.headless_page import open_page, wait_for
from benchmarks.result_files import ROOT

_DOCS = ROOT / "docs"
_PAGES = {
    "page.png": ("reference original", "pendulum.reset(2.2, 0.5)", 22),
    "cartpole_page.png": ("cartpole cartpole-original", "pendulum.reset(0.5, 0, 0.05, 0)", 60),
}


def draw_page(name: str, networks: str, start: str, steps: int) -> None:
    """Writes the picture of a page with two networks after some steps from a start."""
    first, second = networks.split()
    with open_page(first, "--against", second) as browser:
        browser.execute_script(f"pendulum.page.pause(false); {start}")
        browser.execute_script(f"for (let i = 0; i < {steps}; i++) pendulum.step()")
        wait_for(browser, "pendulum.page.map.ready && !pendulum.page.changed")
        browser.save_screenshot(str(_DOCS / name))


def draw_game() -> None:
    """Writes the picture of the game: the network drives after a player."""
    os.environ["SDL_VIDEODRIVER"] = "dummy"
    import pygame

    import keras_pendulum as kp
    from keras_pendulum.environments.pendulum import Pendulum
    from keras_pendulum.play.game import Game, Key
    from keras_pendulum.play.window import Window

    window = Window(wait_for_frame=lambda: None)
    game = Game(Pendulum(), 5, kp.load_policy("reference"), print_line=lambda _: None)
    game.press(Key.POSITIVE)
    for _ in range(200 + 21):
        game.advance()
    window.show(game)
    surface = pygame.display.get_surface()
    assert surface is not None
    pygame.image.save(surface, str(_DOCS / "play.png"))
    game.close()
    window.close()


def main() -> None:
    """Draws all pictures."""
    for name, (networks, start, steps) in _PAGES.items():
        draw_page(name, networks, start, steps)
    draw_game()


if __name__ == "__main__":
    main()
