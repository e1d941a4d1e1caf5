"""The check of a body's promises: it passes bodies that keep them and names the promise that another breaks."""

from dataclasses import replace

import numpy as np
import pytest

from s2c2a.errors import S2C2AError
from s2c2a.robots import check_robot
from s2c2a.robots.simulation import FIDELITIES, SimulatedRobot


class _Faulty(SimulatedRobot):
    """A robot that keeps every promise, to be broken in one place; it counts how often it was closed."""

    closed = 0

    def close(self):
        self.closed += 1


class _ReadsTooManyCables(_Faulty):
    def read(self):
        return replace(super().read(), cables=np.zeros((self.arm.module_count, self.arm.cable_count + 1)))


class _ReadsNaN(_Faulty):
    def read(self):
        return replace(super().read(), cables=np.full((self.arm.module_count, self.arm.cable_count), np.nan))


class _ReadsStatesWithoutAxes(_Faulty):
    def read(self):
        return replace(super().read(), states=super().states()[:, :3])


class _ReadsLongAxes(_Faulty):
    def read(self):
        return replace(super().read(), states=2.0 * super().states())


class _ReadsFlatConfigurations(_Faulty):
    def read(self):
        return replace(super().read(), configurations=super().configurations().ravel())


class _ReportsAnotherAction(_Faulty):
    def send(self, action):
        return super().send(action) + 0.001


class _ReportsNothing(_Faulty):
    def send(self, action):
        super().send(action)


class _ClockStandsStill(_Faulty):
    def read(self):
        return replace(super().read(), time=0.0)


class _TakesNaN(_Faulty):
    def send(self, action):
        return super().send(np.nan_to_num(action))


class _TakesAnyShape(_Faulty):
    def send(self, action):
        return super().send(np.resize(action, (self.arm.module_count, self.arm.cable_count)))


class _RefusesInItsOwnWords(_Faulty):
    def send(self, action):
        values = np.asarray(action)
        if values.ndim != 2 or not np.isfinite(values).all():
            raise ValueError("no")
        return super().send(action)


FAULTS = {
    _ReadsTooManyCables: "cables has shape",
    _ReadsNaN: "not finite",
    _ReadsStatesWithoutAxes: "states has shape",
    _ReadsLongAxes: "end axes",
    _ReadsFlatConfigurations: "configurations",
    _ReportsAnotherAction: "returned another",
    _ReportsNothing: "send",
    _ClockStandsStill: "two control steps took",
    _TakesNaN: "took NaN",
    _TakesAnyShape: "wrong shape",
    _RefusesInItsOwnWords: "ActionError",
}


@pytest.mark.parametrize("fidelity", FIDELITIES)
@pytest.mark.parametrize("preset", ["twin", "simulated"])
def test_the_presets_keep_every_promise_in_every_fidelity(preset, fidelity, request):
    check_robot(SimulatedRobot(request.getfixturevalue(preset), fidelity))


@pytest.mark.parametrize(("kind", "fault"), FAULTS.items(), ids=[kind.__name__ for kind in FAULTS])
def test_a_robot_that_breaks_a_promise_is_named_and_closed(kind, fault, twin):
    robot = kind(twin)
    with pytest.raises(S2C2AError, match=fault):
        check_robot(robot)
    assert robot.closed == 1


def test_a_robot_that_rounds_to_its_encoders_ticks_is_fine(twin):
    class Rounding(SimulatedRobot):
        def send(self, action):
            return 1e-4 * np.round(super().send(action) / 1e-4)

    check_robot(Rounding(twin))


def test_a_robot_that_nothing_watches_is_fine(twin):
    class Unwatched(SimulatedRobot):
        def read(self):
            return replace(super().read(), states=None, configurations=None)

    check_robot(Unwatched(twin))


def test_the_check_is_gentle(twin):
    sent = []

    class Recorder(SimulatedRobot):
        def send(self, action):
            sent.append(super().send(action))
            return sent[-1]

    check_robot(Recorder(twin))
    geometry = Recorder(twin)._geometry
    assert np.max(np.abs(sent) / geometry.action_high) == pytest.approx(0.05)
