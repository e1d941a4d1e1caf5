"""Emulated servos, the arm behind them, and a wire in memory: no real time passes."""

import sys
import time
from pathlib import Path

from servos_in_memory import replace_ports

from s2c2a.arm import load_arm
from s2c2a.lab.emulation.emulator import Emulator, EmulatorOptions
from s2c2a.lab.emulation.faults import GRAMMAR, apply_fault
from s2c2a.lab.emulation.line import Line
from s2c2a.lab.emulation.outputs import describe
from s2c2a.lab.hardware.serial_line import POLL_PERIOD

SHORTEST_STEP = 1e-4  # s


class WireInMemory(Line):
    """The line of an emulator, whose other end is in the same process."""

    opened = 0  # times

    def plug(self):
        self.file = 0
        self.opened += 1
        self.instructions = bytearray()
        self.answers = bytearray()

    def unplug(self):
        self.file = -1
        self._pending.clear()
        self._wire_free = 0.0

    def user_baud_rate(self):
        return self.default_baud_rate

    def receive(self):
        data = bytes(self.instructions)
        self.instructions.clear()
        return data

    def transmit(self, now):
        while self.next_time <= now:
            _, data = self._pending.pop(0)
            self.answers += data


class Port:
    """The port of pyserial at the other end; lost once it was unplugged."""

    is_open = True

    def __init__(self, emulator, name):
        lines = emulator.lines
        named = [line for line in lines if str(line.link) == name]
        self.line = (named or lines)[0]
        self.baudrate = self.line.default_baud_rate
        self._emulator = emulator
        self._opened = self.line.opened
        self._check()

    def _check(self):
        if not self.line.is_plugged or self.line.opened != self._opened:
            raise OSError("the device is gone")

    @property
    def in_waiting(self):
        self._check()
        return len(self.line.answers)

    def read(self, count):
        if count:
            self._emulator.advance(POLL_PERIOD, lambda: self.in_waiting)
        data = bytes(self.line.answers[:count])
        del self.line.answers[:count]
        return data

    def write(self, data):
        self._check()
        self.line.instructions += data
        self._emulator.advance(0.0)

    def reset_input_buffer(self):
        self._check()
        self.line.answers.clear()

    def close(self):
        self.is_open = False


class EmulatorInMemory:
    """An emulator, and the time in which it and its robot live.

    Stands for the module `time` in the whole package: reading and sleeping let the
    emulator go on.
    """

    def __init__(self, monkeypatch):
        self.now = 100.0
        self._emulator = None
        replace_ports(monkeypatch, lambda name, *_, **__: Port(self, str(name)))
        for name, module in list(sys.modules.items()):
            if name.startswith("s2c2a.") and getattr(module, "time", None) is time:
                monkeypatch.setattr(module, "time", self)

    def __getattr__(self, name):
        """Whatever else the module `time` has."""
        return getattr(time, name)

    def monotonic(self):
        return self.now

    def perf_counter(self):
        return self.now

    def sleep(self, seconds):
        self.advance(seconds)

    @property
    def lines(self):
        return self._emulator.lines

    @property
    def servos(self):
        return self._emulator.servos

    def start(self, arm_file, link, **options):
        """Power the servos up, and plug the port in."""
        options = EmulatorOptions(link=Path(link), **options)
        self._emulator = Emulator(load_arm(arm_file), options)
        self.lines[:] = [
            WireInMemory(line.link, line.default_baud_rate) for line in self.lines
        ]
        self._started = self.now
        for line in self.lines:
            line.plug()

    def advance(self, seconds, ends=lambda: False):
        """Let a time pass, or less if a condition becomes true."""
        end = self.now + seconds
        self._serve()
        while self.now < end and not ends():
            self.now = min(max(self._due, self.now + SHORTEST_STEP), end)
            self._serve()

    @property
    def _due(self):
        plant = self._emulator.plant
        physics = self._emulator.late + plant.time + plant.chunk
        return self._started + min([physics, *(line.next_time for line in self.lines)])

    def _serve(self):
        self._emulator.now = self.now - self._started
        self._emulator.serve()

    def inject(self, fault):
        """Let a fault occur, such as "gone 4 0.5"."""
        (parsed,) = GRAMMAR.parse([f"0 {fault}"], self._emulator._ids)
        apply_fault(parsed, self._emulator)

    def status(self):
        """Describe the servos, as in a status file."""
        return describe(self._emulator)
