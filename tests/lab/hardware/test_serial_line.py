"""The serial line: an optional dependency, a lost port, and a line full of noise."""

import os
import subprocess
import sys
import time

import pytest
from servos_in_memory import serve

from s2c2a.errors import S2C2AError
from s2c2a.lab.hardware.bus import BusError, PortLostError
from s2c2a.lab.hardware.dynamixel import DynamixelBus
from s2c2a.lab.hardware.feetech import FeetechBus
from s2c2a.lab.hardware.serial_line import SerialLine, import_serial

from marks import slow_after

MODULES = ("servo_robot", "buses", "bring_up", "feetech", "dynamixel")
WITHOUT_PYSERIAL = "import sys; sys.modules['serial'] = None; import " + ", ".join(
    f"s2c2a.lab.hardware.{name}" for name in MODULES
)


class NoisyPort:
    """Port of pyserial at which random bytes arrive all the time."""

    clock = time
    baudrate = 1_000_000
    in_waiting = 100
    is_open = True

    def read(self, count):
        return os.urandom(count)

    def write(self, data):
        pass

    def reset_input_buffer(self):
        pass

    def close(self):
        pass


class StuckPort(NoisyPort):
    """Port of pyserial that takes no bytes and gives none."""

    in_waiting = 0

    def read(self, count):
        return b""

    def write(self, data):
        raise TimeoutError("Write timeout")


@pytest.fixture
def terminal():
    """One end of a pseudo-terminal, and the name of the other."""
    other, port = os.openpty()
    yield other, os.ttyname(port)
    for end in (other, port):
        os.close(end)


@pytest.fixture
def line(terminal):
    line = SerialLine(terminal[1], 1_000_000)
    yield line
    line.close()


def test_the_drivers_are_imported_without_pyserial():
    subprocess.run([sys.executable, "-c", WITHOUT_PYSERIAL], check=True)


def test_a_missing_pyserial_is_reported_with_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "serial", None)
    with pytest.raises(S2C2AError, match=r"install it.*\[hardware\]"):
        import_serial()


def test_bytes_that_arrive_are_read_at_once(terminal, line):
    os.write(terminal[0], b"answer")
    assert line.read(time.monotonic() + 10.0) == b"answer"


def test_bytes_from_before_an_instruction_are_dropped(terminal, line):
    os.write(terminal[0], b"old")
    line.write(b"instruction")
    assert os.read(terminal[0], 100) == b"instruction"
    assert line.read(time.monotonic() + 0.01) == b""


@pytest.mark.usefixtures("line")
def test_a_second_program_cannot_take_the_port(terminal):
    with pytest.raises(BusError, match=r"cannot be opened.*no other program uses"):
        SerialLine(terminal[1], 1_000_000)


@pytest.mark.parametrize(
    ("kind", "read"),
    [
        (DynamixelBus, lambda bus: bus.info(1)),
        (FeetechBus, lambda bus: bus.read_states([1])),
    ],
)
def test_an_unplugged_port_is_lost(kind, read):
    other, port = os.openpty()
    bus = kind(os.ttyname(port), 1_000_000)
    os.close(port)
    os.close(other)
    uses = [
        lambda: read(bus),
        lambda: bus.send_goals({1: 0}),
        lambda: bus.set_torque([1], False),
        lambda: bus.scan([1]),
        lambda: bus.set_baud_rate(57_600),
    ]
    for use in uses:
        with pytest.raises(PortLostError):
            use()
    bus.close()
    with pytest.raises(PortLostError, match="is closed; open a new bus"):
        bus.scan([1])


@pytest.mark.parametrize("kind", slow_after(1, [DynamixelBus, FeetechBus]))
def test_a_line_full_of_noise_ends_with_an_error(monkeypatch, kind):
    serve(NoisyPort(), monkeypatch)
    bus = kind("fake", 1_000_000)
    assert bus.scan([1]) == []
    with pytest.raises(BusError, match=r"1\]? .*not answer"):
        bus.set_torque([1], False)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [DynamixelBus, FeetechBus])
def test_a_port_that_takes_no_bytes_is_a_servo_without_an_answer(monkeypatch, kind):
    serve(StuckPort(), monkeypatch)
    bus = kind("fake", 1_000_000)
    bus.send_goals({1: 0})
    assert bus.scan([1]) == []
    with pytest.raises(BusError, match=r"1\]? .*not answer"):
        bus.set_torque([1], False)


def test_a_missing_port_is_named_once_with_its_cause(tmp_path):
    port = str(tmp_path / "ttyNone")
    with pytest.raises(BusError, match="cannot be opened: No such file") as refused:
        SerialLine(port, 57600)
    assert str(refused.value).count(port) == 1
