"""A body and a driver of a few lines, and a clock that a test moves."""

import numpy as np
import pytest

from s2c2a.arm import ArmGeometry
from s2c2a.robots import Robot, checked_action
from s2c2a.runtime import StepClock
from s2c2a.spaces import Reading, Sensor


class Time(StepClock):
    """Passes when somebody waits for it, or when a test says so."""

    def let_pass(self, seconds):
        self.wait_until(self.now() + seconds)


class Puppet(Robot):
    """An arm of metal whose cables are at once where they are sent; it notes what happens to it.

    Attributes:
        before_read: called before every reading, with the number of readings so far.
        before_send: called before every action that is sent, with the number of those
            so far.
    """

    def __init__(self, arm, clock):
        self.arm, self.clock, self.geometry = arm, clock, ArmGeometry.of(arm)
        self.notes, self.sent, self.moments, self.reads = [], [], [], 0
        self.before_read = self.before_send = lambda number: None
        self.at = self.geometry.action_neutral

    @property
    def sensors(self):
        room = np.abs(self.geometry.action_scale).max()
        shape = self.geometry.action_neutral.shape
        return {
            "cables": Sensor(
                shape,
                "m",
                self.geometry.action_low - room,
                self.geometry.action_high + room,
                40 * room,
            ),
            "warmth": Sensor((), "K"),
        }

    def open(self):
        self.notes.append("open")
        self.began, self.at = self.clock.now(), self.geometry.action_neutral
        return self.read()

    def read(self):
        self.before_read(self.reads)
        self.reads += 1
        return Reading(
            self.clock.now() - self.began,
            {"cables": self.at + 1e-9 * self.reads, "warmth": np.array(300.0)},
        )

    def send(self, action):
        self.before_send(len(self.sent))
        self.at = checked_action(action, self.geometry)
        self.sent.append(self.at)
        self.moments.append(self.clock.now())
        return self.at

    def close(self):
        self.notes.append("close")


class Actor:
    """A driver that bends every module towards x as far as it is told to, and notes what it is given."""

    sensors = ("cables",)

    def __init__(self, arm):
        self.arm, self.geometry = arm, ArmGeometry.of(arm)
        self.starts, self.steps, self.corrected = [], [], []
        self.share, self.before_step = 0.5, lambda number: None

    def start(self, reading):
        self.starts.append(reading)

    def step(self, reading, goal):
        self.before_step(len(self.steps))
        self.steps.append((reading, goal))
        return (
            self.geometry.action_neutral
            + self.share * self.geometry.action_scale[:, None] * self.towards_x
        )

    @property
    def towards_x(self):
        return self.geometry.cable_matrices[:, :, 0]

    def sent(self, action):
        self.corrected.append(action)

    def diagnostics(self):
        return {"planned": np.full((self.arm.module_count, 3), float(len(self.steps)))}


@pytest.fixture
def clock():
    """At zero."""
    return Time()


@pytest.fixture
def puppet(twin, clock):
    """An arm of metal, on that clock."""
    return Puppet(twin, clock)


@pytest.fixture
def actor(twin):
    """What drives it."""
    return Actor(twin)
