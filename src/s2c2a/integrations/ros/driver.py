"""The ROS side as the driver of an arm: messages in, requests of the control out."""

import signal
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Any

from s2c2a.integrations.ros.inputs import Changes, Inputs
from s2c2a.integrations.ros.messages import (
    MARKERS,
    POINT,
    POSE,
    SWITCH,
    TEXT,
    MessageError,
    decode,
)
from s2c2a.integrations.ros.names import Topic
from s2c2a.integrations.ros.node import Node
from s2c2a.live.process import ControlProcess
from s2c2a.live.snapshot import Control
from s2c2a.runtime.emergency import EMERGENCY_STOP

MAX_RATE = 100.0  # Hz, of changed requests; the control loops run at 10 to 50 Hz
LOG_INTERVAL = 1.0  # s between two lines about one topic; a person reads no more
DRIVING = ("target/point", "target/pose", "task")
"""Topics that show that somebody drives; obstacles alone move nothing."""
STOP = "stop"
EMERGENCY = "emergency_stop"

Log = Callable[[str], None]


class RosDriver:
    """Asks the control for what accepted messages say.

    Nobody drives before the first target or task, and without one for `timeout`; then
    the arm holds, and returns to rest later, as without a page.

    Attributes:
        refused: number of refused messages.
    """

    def __init__(
        self, control: Control, inputs: Inputs, timeout: float, log: Log
    ) -> None:
        """Read messages from now on; `subscribe` brings them.

        Args:
            control: of the arm.
            inputs: reads the messages.
            timeout: time without a target or task until nobody drives [s].
            log: gets lines for the user.
        """
        self.refused = 0
        self._control = control
        self._timeout = timeout
        self._log = log
        self._logged: dict[str, float] = {}
        self._readers: dict[str, tuple[str, Callable[[Any], Changes]]] = {
            "target/point": (POINT, inputs.point),
            "target/pose": (POSE, inputs.pose),
            "obstacles": (MARKERS, inputs.obstacles),
            "task": (TEXT, inputs.task),
        }
        self._lock = threading.Lock()
        self._filled = threading.Event()
        self._latest: dict[str, bytes] = {}
        self._heard = -float("inf")
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="inputs", daemon=True)
        self._thread.start()

    def subscribe(self, node: Node, namespace: str) -> None:
        """Receive the messages of a node's topics."""
        for name, (kind, _) in self._readers.items():
            node.subscribe(Topic(f"{namespace}/{name}", kind), partial(self.put, name))
        for name in (STOP, EMERGENCY):
            topic = Topic(f"{namespace}/{name}", SWITCH)
            node.subscribe(topic, partial(self.switch, name))

    def put(self, name: str, payload: bytes) -> None:
        """Keep a message until it is its turn; a later one of the topic replaces it."""
        with self._lock:
            self._latest.pop(name, None)  # so that the order is that of arrival
            self._latest[name] = payload
            self._filled.set()

    def switch(self, name: str, payload: bytes) -> None:
        """Obey a stop at once, in the calling thread; what cannot be read stops too."""
        try:
            on = bool(decode(SWITCH, payload).data)
        except MessageError as error:
            self._refuse(name, error)
            on = True
        if on:
            if not self._control.request.stopped:
                self._log(f"{name.replace('_', ' ')} by ROS")
                self._control.halt(f"a message on {name}")
            if name != EMERGENCY:
                return
            # trigger the emergency stop of the process that controls the arm
            if not isinstance(self._control, ControlProcess):
                EMERGENCY_STOP.trigger("a message of ROS")
            elif hasattr(signal, "SIGUSR1"):  # on Windows, the stop of before holds
                self._control.stop_at_once()
        elif name == STOP and self._control.request.stopped:
            self._control.ask(stopped=False)
            self._log("resumed by ROS")

    def close(self) -> None:
        """Read no more messages; nobody drives then."""
        self._ended.set()
        self._thread.join()
        self._control.ask(driven=False)

    def _run(self) -> None:
        while not self._ended.wait(1.0 / MAX_RATE):
            self._filled.wait(1.0 / MAX_RATE)
            with self._lock:
                self._filled.clear()
                latest = self._latest
                self._latest = {}
            for name, payload in latest.items():
                self._obey(name, payload)
            silent = time.monotonic() - self._heard > self._timeout
            if silent and self._control.request.driven:
                self._control.ask(driven=False)
                self._log(f"no target or task for {self._timeout:g} s; the arm holds")

    def _obey(self, name: str, payload: bytes) -> None:
        kind, read = self._readers[name]
        try:
            changes = read(decode(kind, payload))
        except MessageError as error:
            return self._refuse(name, error)
        if name in DRIVING:
            self._heard = time.monotonic()
            changes = self._with_goal({"driven": True, **changes})
        self._control.ask(**changes)

    def _with_goal(self, changes: Changes) -> Changes:
        """The changes, with the place of the tip as the target where none is given."""
        latest = self._control.latest
        if changes.get("task") or "target" in changes or latest is None:
            return changes
        if self._control.request.driven and not self._control.request.task:
            return changes  # an empty task beside a target
        return {**changes, "target": latest.tip, "axis": None, "shape": None}

    def _refuse(self, name: str, error: MessageError) -> None:
        """Count a message, and log it if the last line about its topic is old."""
        self.refused += 1
        now = time.monotonic()
        if now - self._logged.get(name, -float("inf")) > LOG_INTERVAL:
            self._logged[name] = now
            # whoever wrote the message must not write to the terminal
            text = "".join(each if each.isprintable() else "?" for each in str(error))
            self._log(f"refused a message on {name}: {text}")
