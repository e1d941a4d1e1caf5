"""Make the pictures of docs/guides/live.md; needs Chromium.

Run `python tools/make_pictures.py`. `tools/moving_pictures.py` makes the moving ones.
"""

import io
import shutil
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from PIL import Image
from playwright.sync_api import sync_playwright

from s2c2a.live.cli.live import running_page
from s2c2a.live.request import Obstacle

FOLDER = Path(__file__).parents[1] / "docs" / "pictures"
DESKTOP = {"width": 1280, "height": 800}
PHONE = {"width": 390, "height": 844}


@contextmanager
def headless_browser():
    """Chromium with software rendering."""
    flags = ["--headless", "--no-sandbox", "--enable-unsafe-swiftshader"]
    with sync_playwright() as playwright:
        yield playwright.chromium.launch(
            executable_path=shutil.which("chromium"), args=flags
        )


def save_screenshot(page, name: str) -> None:
    """Save a screenshot at three quarters of its size."""
    picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    small = picture.resize((picture.width * 3 // 4, picture.height * 3 // 4))
    small.save(FOLDER / f"{name}.png", optimize=True)


def open_page(browser, address: str, size: dict):
    """Open the live page and close its notification about graphics cards."""
    page = browser.new_page(viewport=size)
    page.set_default_timeout(120_000)
    page.goto(address)
    page.get_by_text("Drag the violet ball").wait_for()
    close = page.locator(".mantine-Notification-closeButton")
    if close.count():
        close.first.click()
    return page


def make_live_pictures() -> None:
    """Take screenshots of a target, an obstacle, plots, and an unreachable target."""
    with (
        running_page("twin_arm", out=Path("runs"), port=8192) as (control, live),
        headless_browser() as browser,
    ):
        page = open_page(browser, live.gate.address, DESKTOP)
        for share in np.linspace(0, 1, 30):
            control.ask(target=(0.2 * share, -0.1 * share, 0.6 - 0.055 * share))
            time.sleep(0.1)
        time.sleep(3.0)
        save_screenshot(page, "live-target")
        page.get_by_role("tab", name="Avoid").click()
        obstacle = Obstacle((0.03, -0.01, 0.6), 0.08)
        control.ask(target=(0.0, 0.0, 0.6), obstacles=(obstacle,))
        time.sleep(5.0)
        save_screenshot(page, "live-obstacle")
        page.get_by_text("Plots").click()
        control.ask(task="circle", playing=True, obstacles=())
        time.sleep(16.0)
        save_screenshot(page, "live-plots")
        control.ask(task=None)
        page.close()
        control.ask(obstacles=(), target=(0.0, 0.0, 0.6))
        page = open_page(browser, live.gate.address, PHONE)
        control.ask(target=(0.22, -0.12, 0.63))
        time.sleep(6.0)
        save_screenshot(page, "live-telephone")


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    make_live_pictures()
