"""A servo bus in memory, for tests of the robot above it."""

from dataclasses import replace

from s2c2a.lab.hardware.bus import (
    BusError,
    PortLostError,
    ServoBus,
    ServoInfo,
    ServoState,
)

WATCHDOG = 0.4  # s
SOUND = ServoState(0, 0.0, 0.1, 5.0, 30.0)


class FakeServoBus(ServoBus):
    """Servos that reach their goals at once.

    Attributes:
        states: by id; a servo without one does not answer.
        goals: every packet of goals, with its time.
        currents: every current that was set [A].
        torques: last torque by id.
        watchdogs: last time of the watchdog by id.
        lost: whether the port is gone.
    """

    ticks_per_turn = 4096
    torque_constant = 0.35
    baud_rates = (1_000_000,)

    def __init__(self, ids, clock):
        self.states = dict.fromkeys(ids, SOUND)
        self.clock = clock
        self.goals = []
        self.currents = []
        self.prepared = []
        self.torques = {}
        self.watchdogs = {}
        self.restarted = set()
        self.lost = False
        self.is_open = True

    def scan(self, ids=()):
        return [ServoInfo(id, 1200, "xl330-m288", 52) for id in ids]

    def set_baud_rate(self, baud_rate):
        raise AssertionError

    def assign(self, id, new_id, baud_rate):
        raise AssertionError

    def prepare(self, ids, current, speed):
        self.prepared.append((tuple(ids), speed))
        self.restarted -= set(ids)
        self.currents.append(current)

    def set_torque(self, ids, on):
        self._check_port()
        self.torques |= dict.fromkeys(ids, on)
        if on and self.has_watchdog:
            self.watchdogs |= dict.fromkeys(ids, WATCHDOG)

    def set_current(self, ids, current):
        self.currents.append(current)

    def arm_watchdog(self, ids, seconds):
        self._check_port()
        missing = set(ids) - self.states.keys()
        self.watchdogs |= dict.fromkeys(set(ids) - missing, seconds)
        for id in self.watchdogs.keys() & self.states.keys():
            self.states[id] = replace(self.states[id], watchdog_tripped=False)
        if missing:
            raise BusError(f"servos {missing} do not answer")

    def send_goals(self, goals):
        self._check_port()
        self.goals.append((self.clock.now, dict(goals)))
        for id in goals.keys() & self.states.keys():
            self.states[id] = replace(self.states[id], position=goals[id])

    def read_states(self, ids):
        self._check_port()
        return {id: self.states[id] for id in ids if id in self.states}

    def read_patiently(self, ids, seconds):
        return self.read_states(ids)

    def reboot(self, id):
        raise AssertionError

    def close(self):
        self.is_open = False

    def _check_port(self):
        if self.lost:
            raise PortLostError("the port is gone; plug it in again")
