"""Torque of DYNAMIXEL servos whose goals can be lost on the line."""

import pytest

from s2c2a.lab.hardware import serial_bus
from s2c2a.lab.hardware.bus import BusError
from s2c2a.lab.hardware.dynamixel import DynamixelBus


class SilentLine:
    """A line on which no servo answers."""

    port = "fake"
    baud_rate = 1_000_000
    latency = 0.0
    sent: list[bytes]

    def __init__(self):
        self.sent = []

    def write(self, data):
        self.sent.append(data)

    def read(self, deadline):
        return b""

    def ask(self, packet, patience, quiet_time):
        return b""

    def drain(self, quiet_time):
        pass

    def wire_time(self, count):
        return 0.0


@pytest.fixture
def bus(monkeypatch):
    monkeypatch.setattr(serial_bus, "SerialLine", lambda *_: SilentLine())
    return DynamixelBus("fake")


def test_servos_confirm_goals_and_watchdogs_before_they_are_switched_on(bus):
    written = []
    bus.write = lambda *values: written.append(values)
    bus._checked_states = lambda ids: {}
    bus.send_goals({1: 100, 2: 200})
    bus.set_torque([1, 2], on=True)
    assert written == [
        (1, "goal_position", 100),
        (2, "goal_position", 200),
        (1, "watchdog", 20),
        (2, "watchdog", 20),
        (1, "torque", 1),
        (2, "torque", 1),
    ]


def test_no_servo_is_switched_on_if_one_does_not_confirm_its_goal(bus):
    bus.send_goals({1: 100, 2: 200})
    before = len(bus._line.sent)
    with pytest.raises(BusError, match="servo 1 on fake does not answer"):
        bus.set_torque([1, 2], on=True)
    packets = bus._line.sent[before:]
    torque_packets = [packet for packet in packets if packet[7] == 0x83]
    assert torque_packets == []


def test_servos_are_switched_off_without_their_goals(bus):
    written = []
    bus.write = lambda *values: written.append(values)
    bus.send_goals({1: 100})
    bus.set_torque([1], on=False)
    assert written == [(1, "torque", 0)]
