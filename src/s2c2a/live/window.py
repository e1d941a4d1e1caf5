"""A window on an arm: viser behind the gate, the scene, and what is drawn in it. The live page and `view` share it."""

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
from s2c2a.viz.mounting import Mounting

FRAME = 1 / 30  # s between frames
BRAND = (31, 95, 196)
# in parts of the arm's length
CAMERA = (1.75, -1.85, 1.2)
LOOK_AT = (0.12, 0.1, 0.55)
# of a telephone, its lower half under the panel
UPRIGHT_CAMERA = (2.7, -2.9, 1.5)
UPRIGHT_LOOK_AT = (0.0, 0.0, 0.1)

# of browsers that have just gone
warnings.filterwarnings("ignore", message="Queued a .* on a closed connection")


class Window:
    """What browsers see of one arm; nobody comes in before `open`.

    Attributes:
        arm: that is seen.
        server: viser's.
        scene: the arm, and what is round it.
        gate: where browsers come in, once it is open.
        closing: whether it is over.
    """

    gate: Gate
    _drawing: threading.Thread | None = None

    def __init__(self, arm: ArmSpec):
        """A viser server on 127.0.0.1 that takes websockets from its gate alone, and the arm straight."""
        # an origin that no page can have
        self.arm = arm
        self._secret = f"gate://{secrets.token_hex(16)}"
        with only_with(self._secret), redirect_stdout(io.StringIO()):
            self.server = viser.ViserServer(
                host=HOST, port=0, label=f"s2c2a · {arm.name}", verbose=False
            )
        self.server.gui.configure_theme(
            show_logo=False, show_share_button=False, brand_color=BRAND
        )
        self.server.initial_camera.position, self.server.initial_camera.look_at = (
            camera_of(arm)
        )
        self.server.initial_camera.fov = np.deg2rad(40)
        self.server.on_client_connect(self._look_upright)
        self.scene = ArmScene(self.server.scene, arm)
        self.closing = threading.Event()

    def open(self, port: int, on_stop: Callable[[], bool] | None = None) -> Self:
        """Let browsers in on a port, or on the next free one; each has a Stop where `on_stop` takes it. Returns itself.

        Raises:
            S2C2AError: no port is free.
        """
        self.gate = Gate(port, self.server.get_port(), self._secret, on_stop)
        return self

    def every(self, act: Callable[[float], None]) -> None:
        """Draw frame after frame until it closes, in a thread of its own; told how long the last one was ago [s]."""

        def again() -> None:
            for passed in frames(FRAME, self.closing):
                try:
                    act(passed)
                # the next frame may be drawn again; it is told once
                except Exception as error:
                    warnings.warn(
                        f"a frame could not be drawn: {error!r}", stacklevel=1
                    )

        self._drawing = threading.Thread(target=again, name="scene", daemon=True)
        self._drawing.start()

    def close(self) -> None:
        """Close the gate and the page."""
        self.closing.set()
        if self._drawing is not None:
            self._drawing.join(2.0)
        self.gate.close()
        with redirect_stdout(io.StringIO()):
            self.server.stop()

    async def _look_upright(self, client: viser.ClientHandle) -> None:
        """Show a telephone, whose panel hides the lower half, the arm in the upper one."""
        if client.camera.image_height > 1.2 * client.camera.image_width:
            upright = camera_of(self.arm, UPRIGHT_CAMERA, UPRIGHT_LOOK_AT)
            client.camera.position, client.camera.look_at = upright


def camera_of(
    arm: ArmSpec, place: Point = CAMERA, aim: Point = LOOK_AT
) -> Float[np.ndarray, "2 3"]:
    """Where the camera is first, and where it looks to, for this arm's mounting; base frame [m]."""
    mounting = Mounting.of(arm)
    return arm.length * np.array([mounting.placed(place), mounting.placed(aim)])


def across_the_screen(arm: ArmSpec) -> Float[np.ndarray, "3"]:
    """The direction to the right on the screen, seen from where the camera is first, base frame."""
    place, aim = camera_of(arm)
    across = np.cross(aim - place, Mounting.of(arm).turn[2])
    return across / np.linalg.norm(across)


def sound_value(part: Any) -> Any:
    """The value of a slider or dropdown, whatever a browser said: brought within what it offers, and shown so."""
    value = part.value
    if isinstance(part, viser.GuiSliderHandle):
        value = min(max(value, part.min), part.max)
    elif isinstance(part, viser.GuiDropdownHandle) and value not in part.options:
        value = part.options[0]
    if value != part.value:
        part.value = value
    return value


def frames(period: float, over: threading.Event) -> Iterator[float]:
    """Moments a period apart until it is over, and how long the one before was ago [s].

    Moments that pass while something is drawn are left out: others get their turn
    before the next one.
    """
    begun = time.perf_counter()
    number = 0
    before = 0.0
    while not over.wait(max(0.0, begun + number * period - time.perf_counter())):
        now = time.perf_counter() - begun
        yield now - before
        before = now
        number = max(number + 1, math.ceil((time.perf_counter() - begun) / period))
