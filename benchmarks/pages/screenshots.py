"""The pictures of the page and of the game in docs/.

    python -m benchmarks.pages.screenshots

Writes docs/page.png and docs/cartpole_page.png with a browser without a screen, and docs/play.png.
It needs Chromium and its chromedriver, and takes a minute.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path

from benchmarks.result_files import ROOT

_DOCS = ROOT / "docs"
_SIZE = (1280, 657)
_PAGES = {
    "page.png": ("reference original", "pendulum.reset(2.2, 0.5)", 22),
    "cartpole_page.png": ("cartpole cartpole-original", "pendulum.reset(0.5, 0, 0.05, 0)", 60),
}


def draw_page(name: str, networks: str, start: str, steps: int, folder: Path) -> None:
    """Writes the picture of a page with two networks after some steps from a start."""
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    from keras_pendulum.page import __main__ as page_command

    first, second = networks.split()
    out = folder / "page.html"
    page_command.main([first, "--against", second, "--out", str(out)])
    options = webdriver.ChromeOptions()
    options.binary_location = str(shutil.which("chromium"))
    for flag in ("--headless=new", "--no-sandbox", "--disable-gpu"):
        options.add_argument(flag)
    browser = webdriver.Chrome(options, Service(str(shutil.which("chromedriver"))))
    try:
        width, height = _SIZE
        screen = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", screen)
        browser.get(out.as_uri())
        browser.execute_script(f"pendulum.page.pause(false); {start}")
        browser.execute_script(f"for (let i = 0; i < {steps}; i++) pendulum.step()")
        browser.set_script_timeout(60)
        browser.execute_async_script(
            "const done = arguments[0];"
            "const wait = () => pendulum.page.map.ready && !pendulum.page.changed"
            "  ? done() : setTimeout(wait, 50); wait()"
        )
        browser.save_screenshot(str(_DOCS / name))
    finally:
        browser.quit()


def draw_game() -> None:
    """Writes the picture of the game: the network drives after a player."""
    os.environ["SDL_VIDEODRIVER"] = "dummy"
    import pygame

    import keras_pendulum as kp
    from keras_pendulum.environments.pendulum import Pendulum
    from keras_pendulum.play.game import Game, Key
    from keras_pendulum.play.played_task import played_task
    from keras_pendulum.play.window import Window

    window = Window(wait_for_frame=lambda: None)
    game = Game(played_task(Pendulum()), 5, kp.load_policy("reference"), print_line=lambda _: None)
    game.press(Key.POSITIVE)
    for _ in range(200 + 21):
        game.advance()
    window.show(game.view())
    surface = pygame.display.get_surface()
    assert surface is not None
    pygame.image.save(surface, str(_DOCS / "play.png"))
    game.close()
    window.close()


def main() -> None:
    """Draws all pictures."""
    with tempfile.TemporaryDirectory() as folder:
        for name, (networks, start, steps) in _PAGES.items():
            draw_page(name, networks, start, steps, Path(folder))
    draw_game()


if __name__ == "__main__":
    main()
