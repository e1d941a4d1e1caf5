"""True states of a real arm from a pose tracker, as a sensor of the robot."""

import time
from collections.abc import Callable, Mapping

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError
from s2c2a.spaces import Sensor
from s2c2a.tracking import ModuleEnds, NatNetTracker, QualisysTracker, UdpTracker
from s2c2a.tracking.tracker import Tracker
from s2c2a.tracking.udp import LOCALHOST

SOURCES = (
    "udp, udp:PORT, udp:HOST:PORT, natnet, natnet:HOST, natnet:HOST:LOCAL, "
    "natnet:HOST:LOCAL:UP, qualisys or qualisys:HOST"
)
FIRST_POSES = 5.0  # s in which the first poses must come
POLL_PERIOD = 0.02  # s
MAX_AGE = 1.5  # control periods; an older frame is no measurement of this step


class EndTracking:
    """States of the module ends, in the base frame of the arm.

    Attributes:
        sensors: declaration of the sensor `states`.
    """

    def __init__(self, arm: ArmSpec, source: str):
        """Prepare the tracking; nothing is received yet.

        Args:
            arm: its modules are the bodies "end-1" to "end-M", beside "base".
            source: one of `SOURCES`; HOST is the computer with Motive or QTM, LOCAL the
                address of this computer in its network, UP "y" or "z".

        Raises:
            S2C2AError: there is no such source.
        """
        self._source = source
        self._tracker = _tracker_of(source)
        self._ends = ModuleEnds.of(arm.module_count)
        self._max_age = MAX_AGE * arm.control_period
        shape = (arm.module_count, 6)
        self.sensors: Mapping[str, Sensor] = {
            "states": Sensor(shape, "m, 1", always=False)
        }
        self._missing = np.full(shape, np.nan)

    def start(self) -> None:
        """Begin to receive, and wait for the first poses of all module ends.

        Raises:
            S2C2AError: they do not come; an arm need not move without them.
        """
        self._tracker.start()
        end = time.monotonic() + FIRST_POSES
        while not np.isfinite(self.read()["states"]).all():
            if time.monotonic() > end:
                raise S2C2AError(
                    f"no poses of all module ends arrived from tracking={self._source} "
                    f"in {FIRST_POSES:g} s; start the source, and check its port and "
                    "the names of its bodies (docs/tracking.md)"
                )
            time.sleep(POLL_PERIOD)

    def read(self) -> dict[str, np.ndarray]:
        """Return the states of the newest frame, in the base frame of the arm.

        Returns:
            Sensor `states`, shape (modules, 6): position [m] and axis [1] of each
            module end; NaN if no frame has come, or the newest one is too old.
        """
        frame = self._tracker.latest()
        if frame is None:
            return {"states": self._missing}
        tracked = self._ends.states(frame)
        is_recent = tracked.age <= self._max_age
        return {"states": tracked.states if is_recent else self._missing}

    def close(self) -> None:
        """Stop receiving; allowed more than once."""
        self._tracker.close()


def _tracker_of(source: str) -> Tracker:
    protocol, *address = source.split(":")
    make = _TRACKERS.get(protocol)
    if make is None or len(address) > _MAX_PARTS[protocol] or "" in address:
        raise S2C2AError(f"no tracking source '{source}'; give {SOURCES}")
    return make(*address)


def _udp(*address: str) -> Tracker:
    if not address:
        return UdpTracker()
    *hosts, port = address
    host = hosts[0] if hosts else LOCALHOST
    if not port.isdecimal():
        raise S2C2AError(f"'{port}' is no UDP port; give a number, or {SOURCES}")
    return UdpTracker(host, int(port))


def _natnet(host: str = LOCALHOST, local: str = LOCALHOST, up: str = "y") -> Tracker:
    return NatNetTracker(host, local, up=up)


_TRACKERS: Mapping[str, Callable[..., Tracker]] = {
    "udp": _udp,
    "natnet": _natnet,
    "qualisys": QualisysTracker,
}
_MAX_PARTS = {"udp": 2, "natnet": 3, "qualisys": 1}
