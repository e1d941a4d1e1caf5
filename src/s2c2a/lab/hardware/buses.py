"""Servo buses by the name of their protocol."""

from s2c2a.arm import Servos
from s2c2a.lab.hardware.bus import BusError, ServoBus
from s2c2a.lab.hardware.combined_bus import CombinedBus
from s2c2a.lab.hardware.dynamixel import DynamixelBus
from s2c2a.lab.hardware.dynamixel.tables import model_of
from s2c2a.lab.hardware.feetech import FeetechBus
from s2c2a.lab.hardware.serial_bus import SerialBus
from s2c2a.lab.hardware.serial_line import SerialLine

NO_PORT = (
    "no serial port is named; give one (--robot-option port=/dev/ttyUSB0, or "
    "--port), or write servos.port in the arm file. `s2c2a motors scan` lists the ports"
)


def open_bus(servos: Servos, port: str = "", fast_read: bool = False) -> ServoBus:
    """Open the bus of an arm's servos.

    Args:
        servos: protocol, model, speed, watchdog and limits.
        port: serial port; empty: the one of the arm file. Groups that name a port keep
            theirs.
        fast_read: whether all servos answer in one packet, if the protocol can.

    Raises:
        BusError: no port is named, or it cannot be opened.
    """
    named = servos.model_copy(update={"port": port or servos.port})
    lines: dict[str, SerialLine] = {}
    parts: list[tuple[SerialBus, list[int]]] = []
    try:
        for part, ids in named.parts():
            bus = _open_one(part, fast_read, lines.get(part.port))
            lines.setdefault(part.port, bus.line)
            parts.append((bus, ids))
    except BaseException:
        for bus, _ in parts:
            bus.close()
        raise
    return CombinedBus(parts) if servos.groups else parts[0][0]


def _open_one(servos: Servos, fast_read: bool, line: SerialLine | None) -> SerialBus:
    """Open the bus of servos of one model, on a line that may be open already."""
    if not servos.port:
        raise BusError(NO_PORT)
    largest = servos.limits.current
    if servos.protocol == "feetech":
        return FeetechBus(servos.port, servos.baud_rate, servos.model, largest, line)
    own = servos.own_model
    return DynamixelBus(
        servos.port,
        servos.baud_rate,
        servos.model,
        fast_read,
        servos.watchdog,
        largest,
        None if own is None else model_of(servos.model, own),
        line,
    )
