"""Browser window on an arm: viser behind the gate, and the scene.

The live page and the viewer share it.
"""

import io
import math
import secrets
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from typing import Any, Self

import numpy as np
import viser
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.live.gate import HOST, Gate, only_with
from s2c2a.live.request import Point
from s2c2a.live.scene import ArmScene
from s2c2a.viz.colors import REAL, rgb
from s2c2a.viz.mounting import EYE, LOOK_AT, Mounting

FRAME = 1 / 30  # s between frames
FIELD_OF_VIEW_DEG = 40
# instead of EYE and LOOK_AT for a phone, whose lower half the panel covers
PORTRAIT_CAMERA = (2.7, -2.9, 1.5)
PORTRAIT_LOOK_AT = (0.0, 0.0, 0.1)

# viser warns about browsers that have just disconnected
warnings.filterwarnings("ignore", message="Queued a .* on a closed connection")


class Window:
    """A page that shows one arm; browsers can connect after `open`.

    Attributes:
        arm: the arm.
        server: the viser server.
        scene: the arm and its surroundings.
        gate: access control, after `open`.
        closing: set when the window closes.
    """

    gate: Gate
    _drawing: threading.Thread | None = None

    def __init__(self, arm: ArmSpec):
        """Start a viser server on 127.0.0.1 that shows the straight arm."""
        self.arm = arm
        self._secret = f"gate://{secrets.token_hex(16)}"  # no page has such an origin
        with only_with(self._secret), redirect_stdout(io.StringIO()):
            self.server = viser.ViserServer(
                host=HOST, port=0, label=f"s2c2a · {arm.name}", verbose=False
            )
        self.server.gui.configure_theme(
            show_logo=False, show_share_button=False, brand_color=rgb(REAL)
        )
        camera = self.server.initial_camera
        camera.position, camera.look_at = camera_of(arm)
        camera.fov = np.deg2rad(FIELD_OF_VIEW_DEG)
        self.server.on_client_connect(self._set_portrait_camera)
        self.scene = ArmScene(self.server.scene, arm)
        self.closing = threading.Event()

    def open(
        self,
        port: int,
        on_stop: Callable[[], str] | None = None,
        host: str = HOST,
        on_steer: Callable[[str, Point], None] | None = None,
    ) -> Self:
        """Accept browsers on `port`, or on the next free port; returns the window.

        Args:
            port: of the page.
            on_stop: see `Gate`.
            host: address to listen on.
            on_steer: see `Gate`.

        Raises:
            S2C2AError: no port is free.
        """
        viser_port = self.server.get_port()
        self.gate = Gate(port, viser_port, self._secret, on_stop, host, on_steer)
        return self

    def every(self, draw: Callable[[float], None]) -> None:
        """Call `draw` for each frame until `close`, in a separate thread.

        Args:
            draw: gets the time since the last frame [s].
        """

        def draw_frames() -> None:
            for elapsed in frames(FRAME, self.closing):
                try:
                    draw(elapsed)
                except Exception as error:  # later frames may succeed
                    warnings.warn(f"could not draw a frame: {error!r}", stacklevel=1)

        self._drawing = threading.Thread(target=draw_frames, name="scene", daemon=True)
        self._drawing.start()

    def close(self) -> None:
        """Close the gate and the page."""
        self.closing.set()
        if self._drawing is not None:
            self._drawing.join(2.0)
        self.gate.close()
        with redirect_stdout(io.StringIO()):
            self.server.stop()

    async def _set_portrait_camera(self, client: viser.ClientHandle) -> None:
        """Show the arm in the upper half of a portrait screen."""
        camera = client.camera
        if camera.image_height > 1.2 * camera.image_width:
            camera.position, camera.look_at = camera_of(
                self.arm, PORTRAIT_CAMERA, PORTRAIT_LOOK_AT
            )


def camera_of(
    arm: ArmSpec, position: Point = EYE, look_at: Point = LOOK_AT
) -> Float[np.ndarray, "2 3"]:
    """Initial position of the camera and of what it looks at [m], base frame."""
    mounting = Mounting.of(arm)
    return arm.length * np.array([mounting.placed(position), mounting.placed(look_at)])


def across_the_screen(arm: ArmSpec) -> Float[np.ndarray, "3"]:
    """Unit vector to the right on the screen of the initial camera, base frame."""
    position, look_at = camera_of(arm)
    right = np.cross(look_at - position, Mounting.of(arm).turn[2])
    return right / np.linalg.norm(right)


def checked_value(element: Any) -> Any:
    """Value of an element of a panel, corrected if a browser sent an invalid one."""
    value = element.value
    if isinstance(element, viser.GuiSliderHandle):
        value = min(max(value, element.min), element.max)
    elif isinstance(element, viser.GuiDropdownHandle) and value not in element.options:
        value = element.options[0]
    elif isinstance(element, viser.GuiVector3Handle) and len(value) != 3:
        value = (0.0, 0.0, 0.0)
    if value != element.value:
        element.value = value
    return value


def frames(period: float, closing: threading.Event) -> Iterator[float]:
    """Yield once a period [s] until `closing`: the time since the last frame [s].

    Skips frames that are missed while the caller draws, so that other threads run
    before the next one.
    """
    start = time.perf_counter()
    number = 0
    last = 0.0
    while not closing.wait(max(0.0, start + number * period - time.perf_counter())):
        now = time.perf_counter() - start
        yield now - last
        last = now
        elapsed = time.perf_counter() - start
        number = max(number + 1, math.ceil(elapsed / period))
