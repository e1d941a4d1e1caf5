"""Sensors that fail during a circle, on both presets: the arm holds, then rests."""

import numpy as np
import pytest

from s2c2a.arm.geometry import DEFAULT_ACCELERATION_RATIO
from s2c2a.planning import PAPER
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.runtime import CommandLimits, Loop, StepRequest
from s2c2a.spaces import Reading, Stage
from s2c2a.strategies import pcc_strategy
from s2c2a.tasks import circle

from marks import slow_after

BEGIN = 25
LAST = 95
FAULTS = {
    "frozen": lambda before, now, step: before,
    "jumping": lambda before, now, step: (
        now + (-1) ** step * (1.2 * np.abs(now).max() + 0.02)
    ),
    "zero": lambda before, now, step: np.zeros_like(now),
    "a million times": lambda before, now, step: 1e6 * now,
    "NaN": lambda before, now, step: np.full_like(now, np.nan),
}
COUNTS = (1, 5, 50)


def run(arm, strategy, task, faults=lambda reading: reading):
    """Records of the first steps of a task."""
    with Loop(SimulatedRobot(arm), strategy, faults=faults) as loop:
        return [loop.tick(StepRequest(goal)) for goal in task.goals[:LAST]]


def tips_of(steps):
    """True tip positions."""
    return np.array([step.reading["states"][-1, :3] for step in steps])


@pytest.fixture(scope="module", params=["twin", "simulated"])
def driven(request):
    """Arm, strategy, task, and undisturbed tips; built once for all faults."""
    arm = request.getfixturevalue(request.param)
    strategy, task = pcc_strategy(arm, PAPER), circle(arm)
    return arm, strategy, task, tips_of(run(arm, strategy, task))


def corrupting(corrupt, count):
    """Fault injection that changes all sensors of `count` readings, but not times."""
    kept = []

    def inject(reading: Reading) -> Reading:
        kept.append(reading)
        if not BEGIN <= len(kept) - 1 < BEGIN + count:
            return reading
        before = kept[BEGIN - 1]
        corrupted = {
            name: corrupt(before[name], now, len(kept))
            for name, now in reading.sensors.items()
        }
        return Reading(reading.time, corrupted)

    return inject


@pytest.mark.parametrize("count", slow_after(1, COUNTS))
@pytest.mark.parametrize("fault", FAULTS)
def test_sensors_that_fail_in_a_circle_make_the_arm_hold_then_rest_without_a_jump(
    driven, fault, count
):
    arm, strategy, task, undisturbed = driven
    limits = CommandLimits.of(arm)
    steps = run(arm, strategy, task, corrupting(FAULTS[fault], count))
    commands = np.array([limits.rest, *(step.action for step in steps)])
    degrees, turns = (
        limits.change_sizes(np.diff(commands, order, axis=0))
        / limits.step_limit
        * arm.step_limit_deg
        for order in (1, 2)
    )
    stages = [step.stage for step in steps]
    assert degrees.max() <= 4.0 + 1e-6
    assert turns.max() <= DEFAULT_ACCELERATION_RATIO * 4.0 + 1e-6
    assert set(stages[:BEGIN]) == {Stage.RUN}
    if count < 50:
        assert Stage.RELEASE not in stages
        assert set(stages[BEGIN + count + 5 :]) == {Stage.RUN}
        np.testing.assert_allclose(tips_of(steps)[-10:], undisturbed[-10:], atol=0.02)
    else:
        release = stages.index(Stage.RELEASE)
        assert BEGIN + 10 <= release <= BEGIN + 20
        # 1 s of unsound readings, whatever sound ones came between
        assert stages[BEGIN:release].count(Stage.HOLD) >= 10
        assert stages[-1] is Stage.FAULT
        np.testing.assert_allclose(commands[-1], limits.rest, atol=1e-9)
