"""Emulated servos at the other end of a serial port in memory, with a clock of its own."""

import time
from types import SimpleNamespace

import numpy as np
from homes import arm_with_servos

from s2c2a.arm import save_arm
from s2c2a.lab.emulation.emulator import PROTOCOLS
from s2c2a.lab.emulation.faults import LineFaults
from s2c2a.lab.emulation.servo import MotorState

IDS = list(range(1, 10))
START = 1000.0  # ticks
TICKS_PER_RADIAN = 4096 / (2 * np.pi)
MODELS = {"dynamixel": "xl330-m288", "feetech": "sts3215"}


class Clock:
    """Stands for the module `time`; sleeping moves the motors."""

    def __init__(self):
        self.now = 100.0
        self.sleepers = []

    def monotonic(self):
        return self.now

    def perf_counter(self):
        return self.now

    def sleep(self, seconds):
        self.now += seconds
        for sleeper in list(self.sleepers):
            sleeper(seconds)


class ServosInMemory:
    """A port of pyserial with emulated servos behind it.

    Attributes:
        servos: module by module; some may share an id.
        overlaps: whether the answers of two servos with one id damage each other;
            otherwise they follow each other.
        taut: position beyond which no motor can wind in [ticks].
        watch: called after every packet.
        lags: whether every other answer arrives only after the next request.
        sent: what was written.
        loses: whether an instruction is lost on its way.
        spoil: changes of the answers of a servo, by id.
        echoes: whether the adapter returns what was sent.
    """

    is_open = True

    def __init__(self, clock, protocol="dynamixel", ids=IDS):
        self.baudrate = 1_000_000
        self.protocol = PROTOCOLS[protocol]
        self.clock = clock
        self.servos = [
            self.protocol.make_servo(id, MotorState(ticks=START), 52) for id in ids
        ]
        self.overlaps = False
        self.lags = False
        self._late = None
        self.taut = -1e9
        self.sent = []
        self.loses = lambda instruction: False
        self.spoil = {}
        self.echoes = False
        self.watch = lambda: None
        self.disturbances = LineFaults(np.random.default_rng(0))
        self._decoder = self.protocol.decoder()
        self._received = bytearray()
        clock.sleepers.append(self.move)

    def __getitem__(self, id):
        return next(servo for servo in self.servos if servo.id == id)

    @property
    def in_waiting(self):
        return len(self._received)

    def read(self, count):
        data = bytes(self._received[:count])
        del self._received[:count]
        if not data:
            time.sleep(0.001)  # a port waits, too
        return data

    def silence(self, ids):
        """Take servos from the wire."""
        self.servos[:] = [servo for servo in self.servos if servo.id not in ids]

    def reset_input_buffer(self):
        self._received.clear()

    def close(self):
        self.is_open = False

    def write(self, data):
        self.sent.append(data)
        if self.echoes:
            self._received += data
        for packet in self._decoder.feed(data, self.clock.now):
            if self.loses(packet):
                continue
            answers = self.protocol.answer(packet, self.servos, self.clock.now)
            answers = self.disturbances.disturb(answers)
            self._receive(b"".join(self._on_the_wire(answers)))
            self.watch()

    def _receive(self, data):
        if self.lags and self._late is None:
            self._late = data
            return
        self._received += (self._late or b"") + data
        self._late = None

    def _on_the_wire(self, answers):
        if not self.overlaps:
            return [self.spoil.get(one.id, bytes)(one.data) for one in answers]
        together = {}
        for answer in answers:
            before = together.get(answer.id, answer.data)
            together[answer.id] = bytes(map(int.__and__, before, answer.data))
        return together.values()

    def move(self, seconds):
        """Turn the motors towards their goals."""
        for servo in self.servos:
            command = servo.command()
            ticks = servo.state.ticks
            if command.torque:
                reach = command.speed * seconds * TICKS_PER_RADIAN
                ticks += float(np.clip(command.goal - ticks, -reach, reach))
                ticks = max(ticks, self.taut)
            state = MotorState(ticks=ticks, voltage=self.protocol.supply)
            servo.update(state, seconds, self.clock.now)

    def lead(self, servo):
        """Distance that a servo with torque still goes by itself [ticks]."""
        command = servo.command()
        if not command.torque:
            return 0.0
        return abs(command.goal - max(servo.state.ticks, self.taut))


def replace_ports(monkeypatch, make):
    """Let every serial port that is opened from now on be made by a function."""
    serial = SimpleNamespace(Serial=make, SerialTimeoutException=TimeoutError)
    monkeypatch.setattr("s2c2a.lab.hardware.serial_line.import_serial", lambda: serial)


def serve(port, monkeypatch):
    """Let every serial port that is opened from now on be this one."""
    replace_ports(monkeypatch, lambda *_, **__: port)
    for name in ("EXCHANGE_MARGIN", "LISTEN_MARGIN", "QUIET_TIME"):
        monkeypatch.setattr(f"s2c2a.lab.hardware.serial_bus.{name}", 0.001)
    for protocol in ("dynamixel", "feetech"):
        name = f"s2c2a.lab.hardware.{protocol}.bus.CYCLE_MARGIN"
        monkeypatch.setattr(name, 0.001)
    for name in ("bring_up", "motion_watch", "timing"):
        monkeypatch.setattr(f"s2c2a.lab.hardware.{name}.time", port.clock)
    monkeypatch.setattr("s2c2a.lab.hardware.bring_up.PATIENCE", 0.0)


def arm_file(folder, protocol="dynamixel", **table):
    """An arm file whose servos have a model and limits."""
    limits = {"high_voltage": 8.4}
    servos = {"protocol": protocol, "model": MODELS[protocol], "limits": limits}
    path = folder / "arm.toml"
    save_arm(arm_with_servos(**servos | table), path)
    return str(path)
