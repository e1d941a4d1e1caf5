"""Servo buses by the name of their protocol."""

from s2c2a.arm import Servos
from s2c2a.lab.hardware.bus import BusError, ServoBus
from s2c2a.lab.hardware.dynamixel import DynamixelBus
from s2c2a.lab.hardware.dynamixel.tables import model_of
from s2c2a.lab.hardware.feetech import FeetechBus


def open_bus(servos: Servos, port: str = "", fast_read: bool = False) -> ServoBus:
    """Open the bus of an arm's servos.

    Args:
        servos: protocol, model, speed, watchdog and limits.
        port: serial port; empty: the one of the arm file.
        fast_read: whether all servos answer in one packet, if the protocol can.

    Raises:
        BusError: no port is named, or it cannot be opened.
    """
    name = port or servos.port
    if not name:
        raise BusError(
            "no serial port is named; give one (--robot-option port=/dev/ttyUSB0, or "
            "--port), or write servos.port in the arm file. "
            "`s2c2a motors scan` lists the ports"
        )
    if servos.protocol == "feetech":
        return FeetechBus(name, servos.baud_rate, servos.model, servos.limits.current)
    own = servos.own_model
    return DynamixelBus(
        name,
        servos.baud_rate,
        servos.model,
        fast_read,
        servos.watchdog,
        servos.limits.current,
        None if own is None else model_of(servos.model, own),
    )
