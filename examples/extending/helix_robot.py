"""The Helix arm of Embodied AI (three segments, nine tendons) through its rosbridge.

    s2c2a robot check --robot helix_robot.py:Helix --arm helix.toml \
        --robot-option host=eai-helix-0.local

It was tried against a small imitation of the bridge (tests/examples/helix_bridge.py), and
never with a real Helix. `interface=sdk` speaks the topics of `embodiedai-helix-sdk`,
whose tendon lengths are those within their segment. `interface=transmission` speaks those
of the older `tendon_transmission_node`, which counts from calibrated zero lengths; whether
that node makes up for tendons that pass through other segments was not tried.
"""

import json
import threading
import time

import numpy as np
from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.sync.client import connect

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.errors import RobotError
from s2c2a.robots import Robot, checked_action
from s2c2a.runtime.emergency import EMERGENCY_STOP
from s2c2a.spaces import Reading, Sensor

TENDONS = 9
PATIENCE = 5.0  # s, for the connection and the first lengths
MAX_AGE = 0.5  # s of tendon lengths; the bridge sends them many times a second
MAX_BYTES = 100_000  # of a message
REST_SPEED = 0.02  # m/s, on the way to rest at the start
REST_PERIOD = 0.02  # s
SETTLING = 1.0  # s
STATE = "/helix/state/system_state"
TOPICS = {
    "sdk": ("/helix/command/tendon_lengths", "/helix/estimated/tendon_lengths"),
    "transmission": (
        "/tendon_transmission_node/commands",
        "/tendon_transmission_node/tendon_states",
    ),
}
TYPES = {
    "sdk": ("control_msgs/InterfaceValue", "control_msgs/InterfaceValue"),
    "transmission": ("std_msgs/Float64MultiArray", "sensor_msgs/JointState"),
}


class Helix(Robot):
    """Nine tendon lengths [m], commanded and read over a websocket."""

    def __init__(
        self, arm: ArmSpec, host: str, port: int = 9090, interface: str = "sdk"
    ):
        self.arm = arm
        self._geometry = ArmGeometry.of(arm)
        self._shape = self._geometry.action_neutral.shape
        if self._shape != (3, 3) or arm.actuation != "displacement":
            raise RobotError(
                f"a Helix has three segments of three tendons that are displaced; "
                f"'{arm.name}' is another arm: choose helix.toml"
            )
        if interface not in TOPICS:
            raise RobotError(
                f"interface={interface} was given; choose one of {', '.join(TOPICS)}"
            )
        self._address = f"ws://{host}:{port}"
        self._interface = interface
        straight = np.zeros(self._shape)
        if interface == "sdk":
            straight += self._geometry.lengths[:, None]
        self._straight = straight
        self._socket = None
        self._receiver = None
        self._lengths = np.full(self._shape, np.nan)
        self._heard = -np.inf
        self._state = ""
        self._begun = 0.0

    @property
    def sensors(self):
        margin = 0.1 * np.abs(self._geometry.action_scale)[:, None]
        low = self._geometry.action_low - margin
        high = self._geometry.action_high + margin
        return {"cables": Sensor(low.shape, "m", low, high)}

    def open(self) -> Reading:
        EMERGENCY_STOP.check()
        if self._socket is None:
            self._connect()
        self._wait_for_lengths()
        self._go_to_rest()
        self._begun = time.perf_counter()
        return self.read()

    def read(self) -> Reading:
        moment = time.perf_counter() - self._begun
        age = time.perf_counter() - self._heard
        if age < MAX_AGE:
            return Reading(moment, {"cables": self._lengths - self._straight})
        lost = np.full(self._shape, np.nan)
        fault = f"the Helix has sent no tendon lengths for {age:.1f} s"
        return Reading(moment, {"cables": lost}, fault)

    def send(self, action):
        cables = checked_action(action, self._geometry)
        self._command(cables + self._straight)
        return cables

    def halt(self) -> None:
        """Command the lengths that the tendons have, so that they stop there."""
        if self._socket is not None and np.isfinite(self._lengths).all():
            self._command(self._lengths)

    def close(self) -> None:
        """Disconnect; the Helix holds its last lengths."""
        if self._socket is not None:
            self._socket.close()
            self._receiver.join(PATIENCE)
            self._socket = None

    def _connect(self) -> None:
        try:
            self._socket = connect(
                self._address, open_timeout=PATIENCE, max_size=MAX_BYTES
            )
        except (OSError, InvalidHandshake) as error:
            raise RobotError(
                f"no Helix answers at {self._address}: {error}; check host and network"
            ) from error
        self._receiver = threading.Thread(target=self._receive, daemon=True)
        self._receiver.start()
        command, lengths = TOPICS[self._interface]
        command_type, lengths_type = TYPES[self._interface]
        self._publish(op="advertise", topic=command, type=command_type)
        self._publish(op="subscribe", topic=lengths, type=lengths_type)
        if self._interface == "sdk":
            self._publish(op="subscribe", topic=STATE, type="std_msgs/String")

    def _wait_for_lengths(self) -> None:
        """Wait for lengths, and for the state in which the Helix obeys."""
        needs_state = self._interface == "sdk"
        end = time.perf_counter() + PATIENCE
        while time.perf_counter() < end:
            is_fresh = time.perf_counter() - self._heard < MAX_AGE
            if is_fresh and (self._state == "RUNNING" or not needs_state):
                return
            time.sleep(0.01)
        if np.isfinite(self._heard) and needs_state:
            raise RobotError(
                f"the Helix is in state {self._state or 'unknown'}, and obeys only when "
                "RUNNING: press its button, and wait until it is green"
            )
        raise RobotError(
            f"{self._address} sends nothing on {TOPICS[self._interface][1]}; check the "
            "robot, or try interface=transmission"
        )

    def _go_to_rest(self) -> None:
        """Lead the tendons slowly to their lengths at rest, and let the arm settle."""
        start = self._lengths - self._straight
        count = int(np.ceil(np.abs(start).max() / (REST_SPEED * REST_PERIOD)))
        settling = round(SETTLING / REST_PERIOD)
        for share in [*np.linspace(1.0, 0.0, count + 1), *[0.0] * settling]:
            EMERGENCY_STOP.check()
            self._command(share * start + self._straight)
            time.sleep(REST_PERIOD)

    def _command(self, lengths) -> None:
        """Publish tendon lengths [m], shape (segments, tendons)."""
        values = np.ravel(lengths).tolist()
        message = {"data": values}
        if self._interface == "sdk":
            names = [f"tendon{number}" for number in range(TENDONS)]
            message = {"interface_names": names, "values": values}
        self._publish(op="publish", topic=TOPICS[self._interface][0], msg=message)

    def _publish(self, **message) -> None:
        if self._socket is None:
            raise RobotError("the Helix is not open; call open() before it moves")
        try:
            self._socket.send(json.dumps(message))
        except (ConnectionClosed, OSError) as error:
            raise RobotError(f"the connection to the Helix is lost: {error}") from error

    def _receive(self) -> None:
        """Keep the newest lengths and state, until the connection ends."""
        try:
            for text in self._socket:
                self._hear(text)
        except (ConnectionClosed, OSError):
            return  # `read` reports that nothing comes

    def _hear(self, text) -> None:
        try:
            message = json.loads(text)
            content = message["msg"]
            if message["topic"] == STATE:
                self._state = str(content["data"])
            if message["topic"] == TOPICS[self._interface][1]:
                self._lengths = lengths_of(content)
                self._heard = time.perf_counter()
        except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
            return  # no lengths are no reading


def lengths_of(content) -> np.ndarray:
    """Lengths [m] by the number behind each name: messages may have any order."""
    names = content.get("interface_names", content.get("name"))
    values = content.get("values", content.get("position"))
    if len(names) != TENDONS or len(values) != TENDONS:
        raise ValueError(f"{len(names)} names and {len(values)} values, expected nine")
    lengths = np.full(TENDONS, np.nan)
    for name, value in zip(names, values, strict=True):
        lengths[int(str(name).lstrip("abcdefghijklmnopqrstuvwxyz_"))] = float(value)
    if not np.isfinite(lengths).all():
        raise ValueError("lengths that are missing or no numbers")
    return lengths.reshape(3, 3)
