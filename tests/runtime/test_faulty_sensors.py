"""Sensors that fail in the middle of a circle, on both presets: the command never jumps, the arm holds, then rests."""

import numpy as np
import pytest

from s2c2a.planning import PAPER
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.runtime import Ask, CommandLimits, Loop
from s2c2a.runtime.limits import DEFAULT_ACCELERATION_RATIO
from s2c2a.spaces import Reading, Stage
from s2c2a.strategies import pcc_strategy
from s2c2a.tasks import circle

BEGIN, LAST = 25, 95
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
    """The steps of the task's first part."""
    with Loop(SimulatedRobot(arm), strategy, faults=faults) as loop:
        return [loop.tick(Ask(goal)) for goal in task.goals[:LAST]]


def tips_of(steps):
    """Wherever the tip is seen."""
    return np.array([step.reading["states"][-1, :3] for step in steps])


@pytest.fixture(scope="module", params=["twin", "simulated"])
def driven(request):
    """An arm, what drives it, and its circle; built once for all faults."""
    arm = request.getfixturevalue(request.param)
    strategy, task = pcc_strategy(arm, PAPER), circle(arm)
    return arm, strategy, task, tips_of(run(arm, strategy, task))


def spoiling(spoil, count):
    """Makes all sensors of `count` readings worse, but for their time."""
    kept = []

    def spoilt(reading: Reading) -> Reading:
        kept.append(reading)
        if not BEGIN <= len(kept) - 1 < BEGIN + count:
            return reading
        before, step = kept[BEGIN - 1], len(kept)
        return Reading(
            reading.time,
            {
                name: spoil(before[name], now, step)
                for name, now in reading.sensors.items()
            },
        )

    return spoilt


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("fault", FAULTS)
def test_sensors_that_fail_in_a_circle_make_the_arm_hold_then_rest_and_never_jump(
    driven, fault, count
):
    arm, strategy, task, undisturbed = driven
    limits = CommandLimits.of(arm)
    steps = run(arm, strategy, task, spoiling(FAULTS[fault], count))
    commands = np.array([limits.rest, *(step.action for step in steps)])
    degrees = (
        limits.change_sizes(np.diff(commands, axis=0))
        / limits.step_limit
        * arm.step_limit_deg
    )
    turns = (
        limits.change_sizes(np.diff(commands, 2, axis=0))
        / limits.step_limit
        * arm.step_limit_deg
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
        # 1 s, whatever sound ones came between
        assert stages[BEGIN:release].count(Stage.HOLD) >= 10
        assert stages[-1] is Stage.FAULT
        np.testing.assert_allclose(commands[-1], limits.rest, atol=1e-9)
