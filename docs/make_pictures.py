"""Makes the pictures of docs/live.md and the README: `python docs/make_pictures.py`; needs Chromium."""

import io
import shutil
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from PIL import Image
from playwright.sync_api import sync_playwright

from s2c2a.arm import load_arm
from s2c2a.cli.live import running_page
from s2c2a.evaluation import rollout
from s2c2a.live.request import Obstacle
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.strategies import s2c2a_strategy, shipped_networks
from s2c2a.tasks import task_named
from s2c2a.viz import Trace
from s2c2a.viz.video import save_video

FOLDER = Path(__file__).parent / "pictures"
WIDE, TALL = {"width": 1280, "height": 800}, {"width": 390, "height": 844}


@contextmanager
def headless():
    """A browser that draws in software."""
    with sync_playwright() as playwright:
        flags = ["--headless", "--no-sandbox", "--enable-unsafe-swiftshader"]
        yield playwright.chromium.launch(
            executable_path=shutil.which("chromium"), args=flags
        )


def keep(page, name: str) -> None:
    """Save what is seen, small."""
    picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    picture.resize((picture.width * 3 // 4, picture.height * 3 // 4)).save(
        FOLDER / f"{name}.png", optimize=True
    )


def opened(browser, address: str, size: dict):
    """A page without its word on graphics cards."""
    page = browser.new_page(viewport=size)
    page.set_default_timeout(120_000)
    page.goto(address)
    page.get_by_text("Drag the violet ball").wait_for()
    close = page.locator(".mantine-Notification-closeButton")
    if close.count():
        close.first.click()
    return page


def live_pictures() -> None:
    """The live page with a dragged target, an obstacle, a target out of reach on a telephone."""
    with (
        running_page("twin_arm", out=Path("runs"), port=8192) as (control, live),
        headless() as browser,
    ):
        page = opened(browser, live.gate.address, WIDE)
        for share in np.linspace(0, 1, 30):
            control.ask(target=(0.2 * share, -0.1 * share, 0.6 - 0.055 * share))
            time.sleep(0.1)
        time.sleep(3.0)
        keep(page, "live-target")
        page.get_by_role("tab", name="Avoid").click()
        control.ask(
            target=(0.0, 0.0, 0.6), obstacles=(Obstacle((0.03, -0.01, 0.6), 0.08),)
        )
        time.sleep(5.0)
        keep(page, "live-obstacle")
        page.get_by_text("Plots").click()
        control.ask(task="circle", playing=True, obstacles=())
        time.sleep(16.0)
        keep(page, "live-plots")
        control.ask(task=None)
        page.close()
        control.ask(obstacles=(), target=(0.0, 0.0, 0.6))
        page = opened(browser, live.gate.address, TALL)
        control.ask(target=(0.22, -0.12, 0.63))
        time.sleep(6.0)
        keep(page, "live-telephone")


def moving_picture() -> None:
    """The circle, for the README."""
    arm, task = load_arm("twin_arm"), task_named("circle", load_arm("twin_arm"))
    run = rollout(SimulatedRobot(arm), s2c2a_strategy(shipped_networks(arm)), task)
    save_video(Trace(run, "s2c2a"), arm, FOLDER / "circle", "gif")


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    moving_picture()
    live_pictures()
