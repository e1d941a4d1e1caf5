"""A real robot, its control loop and emulated servos at the other end of a wire."""

import re
from contextlib import contextmanager
from itertools import pairwise

import numpy as np
from homes import arm_with_servos, calibration_with

from s2c2a.arm import ArmGeometry, save_arm, servos_of
from s2c2a.lab.hardware.calibration import save_calibration
from s2c2a.lab.hardware.servo_robot import DynamixelRobot, FeetechRobot
from s2c2a.runtime import Loop, Patience, StepRequest
from s2c2a.runtime.record import build_episode
from s2c2a.spaces import Stage

PERIOD = 4.0  # s of the motion
SHARE = 0.35  # of the full bend
UNSOUND = 0.3  # s without a sound reading before the arm moves to rest
MODELS = {"dynamixel": "xl330-m288", "feetech": "sts3215"}


class Swing:
    """A driver that bends all modules to and fro, or holds them bent."""

    name = "swing"
    sensors = ("cables",)

    def __init__(self, arm, is_steady=False):
        self.arm = arm
        self.geometry = ArmGeometry.of(arm)
        self.is_steady = is_steady

    def start(self, reading):
        self.began = reading.time

    def estimate(self, reading, last_command):
        return reading

    def plan(self, estimate, goal):
        return goal

    def act(self, goal, reading):
        phase = 2 * np.pi * (reading.time - self.began) / PERIOD
        share = SHARE if self.is_steady else SHARE * np.sin(phase)
        towards_x = self.geometry.cable_matrices[:, :, 0]
        bend = share * self.geometry.action_scale[:, None] * towards_x
        return self.geometry.action_neutral + bend

    def sent(self, action):
        pass

    def diagnostics(self):
        return {}


class ArmOnAWire:
    """Emulated servos that are homed, and the robot that drives them.

    Attributes:
        loop: of the robot, while it is driven.
        records: of all steps so far.
    """

    def __init__(self, emulator, folder, protocol="dynamixel", arm=None):
        self.emulator = emulator
        self.port = folder / "port"
        self.arm_file = folder / "arm.toml"
        table = {"protocol": protocol, "model": MODELS[protocol]}
        if protocol == "feetech":
            table["limits"] = {"high_voltage": 8.4}
        self.arm = arm or arm_with_servos(**table)
        save_arm(self.arm, self.arm_file)
        self.calibration = folder / "calibration.json"
        self.records = []
        self.emulator.start(self.arm_file, self.port, homed=True)
        servos = self.emulator.status()["servos"]
        homes = {servo["id"]: servo["position"] for servo in servos}
        save_calibration(calibration_with(self.arm, homes), self.calibration)

    def robot(self, **options):
        kind = {"dynamixel": DynamixelRobot, "feetech": FeetechRobot}
        make = kind[servos_of(self.arm).protocol]
        port = "" if servos_of(self.arm).groups else str(self.port)
        return make(self.arm, port, str(self.calibration), **options)

    @contextmanager
    def driven(self, is_steady=False, **options):
        """Drive the arm; its loop is open meanwhile."""
        patience = Patience.of(self.arm.control_rate, unsound=UNSOUND)
        self.loop = Loop(
            self.robot(**options),
            Swing(self.arm, is_steady),
            patience=patience,
            on_step=self.records.append,
        )
        with self.loop:
            yield self.loop

    def steps(self, count):
        return [self.loop.tick(StepRequest()) for _ in range(count)]

    def sees(self, fault, pattern, most):
        """Let a fault occur, which is seen in a number of steps, in such words."""
        last = len(self.records) + self.loop.late_steps + most
        self.emulator.inject(fault)
        (record,) = self.steps(1)
        while not record.fault and len(self.records) < last:
            (record,) = self.steps(1)
        assert len(self.records) + self.loop.late_steps <= last, f"{fault} seen late"
        assert re.search(pattern, record.fault), f"{fault}: {record.fault}"

    def wound_in(self):
        """Servo of the cable that is wound in most."""
        servos = self.emulator.status()["servos"]
        return min(servos, key=lambda servo: servo["displacement"])["id"]

    def largest_error(self, records):
        """Largest distance of what was measured from what was sent before [m]."""
        return max(
            np.nanmax(np.abs(now.reading["cables"] - before.action), initial=0.0)
            for before, now in pairwise(records)
        )

    def steps_until(self, stage, most=60):
        """Steps until the arm is in a stage; the last one."""
        for _ in range(most):
            (record,) = self.steps(1)
            if record.stage is stage:
                return record
        raise AssertionError(f"the arm is not in {stage} after {most} steps")

    def led_to_rest(self):
        """Whether the arm is led to rest, and stays stopped there."""
        self.steps_until(Stage.RELEASE)
        last = self.steps_until(Stage.FAULT)
        return np.allclose(
            last.action, ArmGeometry.of(self.arm).action_neutral, atol=1e-4
        )

    def servo(self, id):
        """State of one servo as the emulator knows it."""
        servos = self.emulator.status()["servos"]
        return next(servo for servo in servos if servo["id"] == id)

    def places(self):
        """True displacement of every cable [m]."""
        return [servo["displacement"] for servo in self.emulator.status()["servos"]]

    def wait_until(self, is_reached, seconds=20.0):
        """Wait until the emulator's state fulfils a condition."""
        end = self.emulator.now + seconds
        while not is_reached(self.emulator.status()):
            assert self.emulator.now < end, f"not reached in {seconds} s"
            self.emulator.sleep(0.02)

    def check_limits(self):
        """Assert that no command or current exceeded its limit."""
        status = self.emulator.status()
        limits = servos_of(self.arm).limits
        tick = 2 * np.pi * self.arm.motor.pulley_radius / 4096
        highest = ArmGeometry.of(self.arm).action_high.max()
        assert status["largest_command"] <= highest + tick
        assert status["largest_current"] <= 1.05 * limits.current  # with its noise

    def check_records(self):
        """Assert that every step so far was recorded, with what was measured."""
        numbers = [record.number for record in self.records]
        assert numbers == list(range(len(numbers)))
        sound = [record for record in self.records if not record.fault]
        assert len(sound) >= 3
        assert all(np.isfinite(record.reading["cables"]).all() for record in sound)
        episode = build_episode(self.records, self.arm)
        assert np.isfinite(episode["actions"]).all()
