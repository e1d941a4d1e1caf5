"""Protocols of emulated servos by name."""

from s2c2a.arm.servos import Servos
from s2c2a.errors import S2C2AError
from s2c2a.lab.emulation.dynamixel_protocol import DynamixelProtocol
from s2c2a.lab.emulation.feetech_protocol import FeetechProtocol
from s2c2a.lab.emulation.instructions import ServoProtocol

PROTOCOLS: dict[str, ServoProtocol] = {
    "dynamixel": DynamixelProtocol(),
    "feetech": FeetechProtocol(),
}


def protocol_of(table: Servos) -> ServoProtocol:
    """Return the protocol of an arm's servos.

    Raises:
        S2C2AError: the servos do not know the baud rate.
    """
    protocol = PROTOCOLS[table.protocol]
    baud_rates = protocol.make_servo.baud_rates
    if table.baud_rate not in baud_rates:
        raise S2C2AError(
            f"servos.baud_rate {table.baud_rate} is not a speed of {table.protocol} "
            f"servos; choose one of {', '.join(map(str, baud_rates))}"
        )
    return protocol
