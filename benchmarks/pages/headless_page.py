"""A page of networks in a browser without a screen. It needs Chromium and its chromedriver."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from selenium.webdriver import Chrome

SIZE = (1280, 657)


@contextmanager
def open_page(*words: str) -> Iterator[Chrome]:
    """Opens the page that `python -m keras_pendulum.page` makes of some words."""
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    from keras_pendulum.page import __main__ as page_command

    options = webdriver.ChromeOptions()
    options.binary_location = str(shutil.which("chromium"))
    for flag in ("--headless=new", "--no-sandbox", "--disable-gpu"):
        options.add_argument(flag)
    with TemporaryDirectory() as folder:
        out = Path(folder, "page.html")
        page_command.main([*words, "--out", str(out)])
        browser = webdriver.Chrome(options, Service(str(shutil.which("chromedriver"))))
        try:
            width, height = SIZE
            screen = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
            browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", screen)
            browser.set_script_timeout(60)
            browser.get(out.as_uri())
            wait_for(browser, "window.pendulum")
            yield browser
        finally:
            browser.quit()


def wait_for(browser: Chrome, condition: str) -> None:
    """Waits until a condition holds in the page."""
    browser.execute_async_script(
        "const [done] = arguments;"
        f"const wait = () => {condition} ? done() : setTimeout(wait, 50); wait()"
    )
