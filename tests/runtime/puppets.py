"""Minimal robot and driver, and a clock that tests advance."""

import numpy as np

from s2c2a.arm import ArmGeometry
from s2c2a.robots import Robot, checked_action
from s2c2a.runtime import StepClock
from s2c2a.spaces import Reading, Sensor


class ManualClock(StepClock):
    """Clock that tests can advance, too."""

    def let_pass(self, seconds):
        self.wait_until(self.now() + seconds)


class Puppet(Robot):
    """Real robot whose cables reach commands at once; it records all calls.

    Attributes:
        before_read: called before every reading, with the number of readings so far.
        before_send: called before every action is sent, with the number of actions
            so far.
    """

    def __init__(self, arm, clock):
        self.arm = arm
        self.clock = clock
        self.geometry = ArmGeometry.of(arm)
        self.notes = []
        self.sent = []
        self.moments = []
        self.reads = 0
        self.before_read = self.before_send = lambda number: None
        self.position = self.geometry.action_neutral

    @property
    def sensors(self):
        reach = np.abs(self.geometry.action_scale).max()
        shape = self.geometry.action_neutral.shape
        return {
            "cables": Sensor(
                shape,
                "m",
                self.geometry.action_low - reach,
                self.geometry.action_high + reach,
                40 * reach,
            ),
            "warmth": Sensor((), "K"),
        }

    def open(self):
        self.notes.append("open")
        self.opened_at = self.clock.now()
        self.position = self.geometry.action_neutral
        return self.read()

    def read(self):
        self.before_read(self.reads)
        self.reads += 1
        return Reading(
            self.clock.now() - self.opened_at,
            {"cables": self.position + 1e-9 * self.reads, "warmth": np.array(300.0)},
        )

    def send(self, action):
        self.before_send(len(self.sent))
        self.position = checked_action(action, self.geometry)
        self.sent.append(self.position)
        self.moments.append(self.clock.now())
        return self.position

    def close(self):
        self.notes.append("close")


class Actor:
    """Driver that bends all modules towards x by a share; it records its inputs."""

    sensors = ("cables",)

    def __init__(self, arm):
        self.arm = arm
        self.geometry = ArmGeometry.of(arm)
        self.starts = []
        self.steps = []
        self.corrected = []
        self.share = 0.5
        self.before_step = lambda number: None

    def start(self, reading):
        self.starts.append(reading)

    def estimate(self, reading, last_command):
        return reading

    def plan(self, estimate, goal):
        return goal

    def act(self, goal, reading):
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
