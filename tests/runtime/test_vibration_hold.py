"""Commands that vibrate for long are held for a while."""

import numpy as np

from s2c2a.runtime import Loop, StepRequest
from s2c2a.runtime.vibration_hold import HOLD_TIME, PATIENCE, VibrationHold

PERIOD = 0.1


def after(hold: VibrationHold, vibrates: bool, seconds: float) -> VibrationHold:
    for _ in range(round(seconds / PERIOD)):
        hold = hold.after(vibrates, PERIOD)
    return hold


def test_only_a_long_vibration_holds_the_command():
    short = after(VibrationHold(), True, PATIENCE - PERIOD)
    assert not short.is_held
    assert not after(after(short, False, PERIOD), True, PATIENCE - PERIOD).is_held
    held = after(short, True, 2 * PERIOD)
    assert held.is_held
    assert not after(held, False, HOLD_TIME + PERIOD).is_held
    # if the vibration goes on, it is held again
    assert not after(held, True, PATIENCE - PERIOD).is_held
    assert after(held, True, PATIENCE + 2 * PERIOD).is_held


def test_a_controller_that_vibrates_is_recorded_and_then_held(puppet, actor, clock):
    with Loop(puppet, actor, clock) as loop:
        steps = []
        for number in range(120):
            actor.share = 0.3 + 0.05 * (-1) ** number
            steps.append(loop.tick(StepRequest()))
        commands = np.array([step.action for step in steps])
        held = [np.ptp(commands[n : n + 10], axis=0).max() == 0.0 for n in range(110)]
        assert any(held)
        assert any("vibrate" in step.vibration for step in steps)


def test_a_player_may_vibrate(puppet, actor, clock):
    with Loop(puppet, actor, clock, monitors_vibration=False) as loop:
        for number in range(120):
            actor.share = 0.3 + 0.05 * (-1) ** number
            assert not loop.tick(StepRequest()).vibration
