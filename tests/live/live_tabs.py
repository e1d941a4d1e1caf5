"""Tabs of a real browser on a live page, and waiting."""

import io
import os
import shutil
import time
from pathlib import Path

import numpy as np
from PIL import Image

from s2c2a.live.window import camera_of
from s2c2a.viz.mounting import Mounting

CHROMIUM = (
    shutil.which("chromium")
    or shutil.which("chromium-browser")
    or shutil.which("google-chrome")
)
# without a graphics card; see benchmarks/
FLAGS = ["--headless", "--no-sandbox", "--enable-unsafe-swiftshader"]
WIDE, TALL = (1280, 800), (390, 844)
# of viser's own page, whenever a thing is dragged
PASSIVE = "Unable to preventDefault inside passive event listener"
FIELD_OF_VIEW = np.deg2rad(40)


class Tab:
    """One page in the browser, and what went wrong on it."""

    def __init__(self, browser, address: str, size=WIDE):
        self.page = browser.new_page(viewport={"width": size[0], "height": size[1]})
        self.page.set_default_timeout(60_000)
        self.size, self.errors = size, []
        self.page.on("console", self._heard)
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.goto(address)

    def _heard(self, said) -> None:
        if said.type == "error" and PASSIVE not in said.text:
            self.errors.append(said.text)

    def stop(self) -> None:
        """Press the Stop that every page has."""
        self.page.get_by_role("button", name="Stop", exact=True).click()

    def place_of(self, point, arm) -> tuple[float, float]:
        """Where a point of the base frame [m] is on the screen, seen from the page's first camera [pixels]."""
        eye, towards = camera_of(arm)
        ahead = (towards - eye) / np.linalg.norm(towards - eye)
        right = np.cross(ahead, Mounting.of(arm).turn[2])
        right /= np.linalg.norm(right)
        up, seen = np.cross(right, ahead), np.asarray(point) - eye
        scale = self.size[1] / 2 / np.tan(FIELD_OF_VIEW / 2) / (seen @ ahead)
        return self.size[0] / 2 + scale * (seen @ right), self.size[1] / 2 - scale * (
            seen @ up
        )

    def drag(self, start, end, steps: int = 12) -> None:
        """Press at one place on the screen, go to another one, let go."""
        mouse = self.page.mouse
        mouse.move(*start)
        time.sleep(0.3)
        mouse.down()
        for share in np.linspace(0, 1, steps + 1)[1:]:
            mouse.move(*(np.array(start) + share * (np.array(end) - start)))
            time.sleep(0.05)
        mouse.up()

    def drag_told(self, point, way, arm, told: list) -> bool:
        """Drag what is at a point of the base frame by so many pixels; whether somebody was told where to."""
        start = np.array(self.place_of(point, arm))
        self.drag(start, start + way)
        time.sleep(1.0)
        return bool(told)

    def seen(self) -> Image.Image:
        """What is on the screen."""
        return Image.open(io.BytesIO(self.page.screenshot())).convert("RGB")

    def keep(self, name: str) -> None:
        """Save what is seen, where a folder for that is named."""
        folder = os.environ.get("S2C2A_SCREENSHOTS")
        if folder:
            Path(folder).mkdir(parents=True, exist_ok=True)
            self.page.screenshot(path=str(Path(folder) / f"{name}.png"))


def drawn_tip(scene):
    """The middle of the plate at the tip of the arm that a scene draws, base frame [m]."""
    return scene._pieces[-2].vertices[-1]


def until(true, seconds: float = 30.0, what: str = "it") -> None:
    """Wait until something is true."""
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, f"{what} has not happened within {seconds:g} s"
        time.sleep(0.05)
