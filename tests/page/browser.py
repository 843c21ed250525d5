"""Headless Chromium, a user of the page in it, and what the user sees."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
from conftest import wait_for
from numpy.typing import NDArray
from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.remote.webelement import WebElement

from keras_pendulum.page import __main__ as page_command

WEB = Path(page_command.__file__).parent / "web"
TIE = 1e-5  # floating-point rounding may change the order of Q-values closer than this
SCREENS = [(1280, 657), (390, 844), (844, 390)]


def find_chromium() -> tuple[str, str] | None:
    """Returns the paths of the browser and of its driver; None unless both are installed."""
    browser = next(filter(None, map(shutil.which, ("chromium", "chromium-browser"))), None)
    driver = shutil.which("chromedriver")
    return (browser, driver) if browser and driver else None


def start(browser: str, driver: str) -> webdriver.Chrome:
    """Starts a browser that logs its errors and its network requests."""
    options = webdriver.ChromeOptions()
    options.binary_location = browser
    for flag in (
        "--headless=new",
        "--no-sandbox",  # the sandbox does not work for root, and the tests open only local files
        "--disable-dev-shm-usage",
        "--disable-gpu",
        "--disable-component-update",
    ):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    # Without the path of the driver, Selenium would search the network for one.
    return webdriver.Chrome(options, Service(driver))


class Player:
    """A user of the page."""

    def __init__(self, driver: webdriver.Chrome) -> None:
        self.driver = driver

    def set_screen(
        self, width: int, height: int, touch: bool | None = None, /, **media: str
    ) -> None:
        """Sets the size of the screen, and preferences such as `color-scheme`.

        A small screen is one that is touched, if `touch` does not say otherwise.
        """
        phone = width < 600
        if touch is None:
            touch = min(width, height) < 450
        self.driver.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": touch})
        size = {"width": width, "height": height, "deviceScaleFactor": 1 + phone, "mobile": phone}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        features = [{"name": f"prefers-{key}", "value": value} for key, value in media.items()]
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})

    def open(self, address: str) -> None:
        """Opens a page and waits until it has started and is painted: before, keys are dropped."""
        self.driver.get(address)
        started = "window.pendulum || document.getElementById('problem')?.hidden !== true"
        painted = "performance.getEntriesByType('paint').length > 0"
        wait_for(lambda: self.run(f"return Boolean({started}) && {painted}"))

    def open_paused(self, address: str) -> None:
        self.open(address)
        self.press(Keys.SPACE)

    def find(self, id: str) -> WebElement:
        return self.driver.find_element(By.ID, id)

    def text(self, id: str) -> str:
        return self.find(id).text

    def button(self, torque: int) -> WebElement:
        return self.driver.find_element(By.CSS_SELECTOR, f'[data-direction="{torque // 2}"]')

    def press(self, *keys: str) -> None:
        """Types keys into the element that has the focus."""
        ActionChains(self.driver, duration=0).send_keys(*keys).perform()

    def finger(self, kind: str, place: tuple[float, float], seconds: float) -> None:
        """Sends a `touchStart`, `touchMove` or `touchEnd` at a time in s."""
        x, y = place
        points = [] if kind == "touchEnd" else [{"x": x, "y": y}]
        event = {"type": kind, "touchPoints": points, "timestamp": seconds}
        self.driver.execute_cdp_cmd("Input.dispatchTouchEvent", event)

    def mouse(self, kind: str, place: tuple[float, float], seconds: float) -> None:
        """Sends a `mousePressed`, `mouseMoved` or `mouseReleased` at a time in s."""
        x, y = place
        event = {"type": kind, "x": x, "y": y, "button": "left", "buttons": 1, "clickCount": 1}
        self.driver.execute_cdp_cmd("Input.dispatchMouseEvent", {**event, "timestamp": seconds})

    def run(self, script: str, *arguments: Any) -> Any:
        return self.driver.execute_script(script, *arguments)

    def state(self) -> dict[str, Any]:
        state: dict[str, Any] = self.run("return pendulum.state()")
        return state

    def focus(self) -> str:
        """Returns the id of the element that has the focus, or its direction or layer."""
        script = "const e = document.activeElement;"
        return str(self.run(f"{script} return e.id || e.dataset.direction || e.dataset.layer"))

    def log(self, kind: str) -> list[dict[str, Any]]:
        """Returns the entries of a browser log since the last call."""
        entries: list[dict[str, Any]] = self.driver.get_log(kind)
        return entries

    def pass_time(self, seconds: int, before: str = "") -> int:
        """Runs a script and the frames of simulated seconds, 60 in each; returns the last step."""
        step = self.run(
            f"{before};"
            "const real = requestAnimationFrame; requestAnimationFrame = () => {};"
            "for (let i = 0; i < 60 * arguments[0]; i++)"
            "  pendulum.page.frame(1000 / 60 * (i + 1), 1000 / 60 * i);"
            "requestAnimationFrame = real; return pendulum.state().steps",
            seconds,
        )
        return int(step)

    def boxes(self, *selectors: str) -> list[dict[str, float]]:
        """Returns the left, right, top, bottom, width, … of each element on the screen, in px."""
        found: list[dict[str, float]] = self.run(
            "return [...arguments].map(s => document.querySelector(s).getBoundingClientRect())",
            *selectors,
        )
        return found

    def redraw(self) -> None:
        """Waits until a frame has drawn everything anew."""
        self.run("pendulum.page.changed = true")
        wait_for(lambda: not self.run("return pendulum.page.changed"))

    def picture(self, id: str) -> NDArray[np.uint8]:
        """Redraws a canvas; returns its pixels [rows, columns, RGBA]."""
        self.redraw()
        width, pixels = self.run(
            "const c = document.getElementById(arguments[0]);"
            # From a copy: the browser warns of a canvas that is read again and again.
            "const copy = new OffscreenCanvas(c.width, c.height).getContext('2d');"
            "copy.drawImage(c, 0, 0);"
            "const d = copy.getImageData(0, 0, c.width, c.height).data;"
            "let s = ''; for (let i = 0; i < d.length; i += 8192)"
            "  s += String.fromCharCode(...d.subarray(i, i + 8192)); return [c.width, s]",
            id,
        )
        flat = np.frombuffer(pixels.encode("latin-1"), np.uint8)
        return flat.reshape(-1, width, 4)


def middle_of(player: Player, id: str) -> tuple[float, float]:
    """Scrolls an element into view and returns its middle on the screen."""
    player.run("arguments[0].scrollIntoView({block: 'center'})", player.find(id))
    (box,) = player.boxes(f"#{id}")
    return box["left"] + box["width"] / 2, box["top"] + box["height"] / 2


def pixels_of(player: Player, canvas: str, colour: str) -> NDArray[np.bool_]:
    """Returns the mask [rows, columns] of the pixels with a colour of the style sheet."""
    hexadecimal = player.run(f"return pendulum.page.view.colours.{colour}")
    found = player.picture(canvas)[..., :3] == list(bytes.fromhex(hexadecimal[1:]))
    return np.asarray(found.all(axis=-1))


def shown(total: float) -> str:
    """Returns a return as the page writes it."""
    return f"{total:.1f}".replace("-", "−")
