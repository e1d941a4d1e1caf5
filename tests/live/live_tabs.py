"""Tabs of a real browser on a live page."""

import io
import shutil

import numpy as np
from PIL import Image

from s2c2a.live.window import FIELD_OF_VIEW_DEG, camera_of
from s2c2a.viz.mounting import Mounting
from waiting import until

CHROMIUM = (
    shutil.which("chromium")
    or shutil.which("chromium-browser")
    or shutil.which("google-chrome")
)
# without a graphics card; see benchmarks/
FLAGS = ["--headless", "--no-sandbox", "--enable-unsafe-swiftshader"]
WIDE = (1280, 800)
TALL = (390, 844)
# viser's own page logs this error at every drag
PASSIVE = "Unable to preventDefault inside passive event listener"
POINTS_AT_OBJECT = """() => [...document.querySelectorAll("canvas")].some(
    (canvas) => canvas.style.cursor === "pointer")"""
FIELD_OF_VIEW = np.deg2rad(FIELD_OF_VIEW_DEG)


class Tab:
    """One page in the browser, and the errors on it."""

    def __init__(self, browser, address: str, size=WIDE):
        self.page = browser.new_page(viewport={"width": size[0], "height": size[1]})
        self.page.set_default_timeout(60_000)
        self.size = size
        self.errors = []
        self.page.on("console", self._log)
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.goto(address)

    def _log(self, message) -> None:
        if message.type == "error" and PASSIVE not in message.text:
            self.errors.append(message.text)

    def stop(self) -> None:
        """Press the Stop button."""
        self.page.get_by_role("button", name="Stop", exact=True).click()

    def place_of(self, point, arm) -> tuple[float, float]:
        """Pixels of a point [m], base frame, seen from the initial camera."""
        camera, look_at = camera_of(arm)
        forward = (look_at - camera) / np.linalg.norm(look_at - camera)
        right = np.cross(forward, Mounting.of(arm).turn[2])
        right /= np.linalg.norm(right)
        up = np.cross(right, forward)
        ray = np.asarray(point) - camera
        width, height = self.size
        scale = height / 2 / np.tan(FIELD_OF_VIEW / 2) / (ray @ forward)
        return width / 2 + scale * (ray @ right), height / 2 - scale * (ray @ up)

    def drag(self, start, end, steps: int = 12) -> None:
        """Drag the object at one pixel to another.

        Without a graphics card, objects may appear late: the drag waits until the
        browser finds one that can be dragged under the mouse.
        """
        mouse = self.page.mouse
        until(lambda: self._finds_object(start), what="an object to be dragged")
        mouse.down()
        for share in np.linspace(0, 1, steps + 1)[1:]:
            mouse.move(*(np.array(start) + share * (np.array(end) - start)))
        mouse.up()

    def _finds_object(self, place) -> bool:
        """Move the mouse to a pixel; whether the cursor shows an object there."""
        for offset in (1.0, 0.0):
            self.page.mouse.move(place[0] + offset, place[1])
        return self.page.evaluate(POINTS_AT_OBJECT)

    def screenshot(self) -> Image.Image:
        """The picture on the screen."""
        return Image.open(io.BytesIO(self.page.screenshot())).convert("RGB")


def drawn_tip(scene):
    """Center of the plate at the drawn arm's tip, base frame [m]."""
    return scene._pieces[-2].vertices[-1]
