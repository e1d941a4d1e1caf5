"""The feedback fades while the arm vibrates, and returns to less each time."""

import numpy as np
import pytest

from s2c2a.runtime import Loop, StepRequest
from s2c2a.runtime.feedback import (
    CALM_TIME,
    FADE_TIME,
    HALF,
    HALF_TIME,
    HOLD_AFTER,
    Feedback,
)

PERIOD = 0.1


def after(feedback: Feedback, vibrates: bool, seconds: float) -> Feedback:
    for _ in range(round(seconds / PERIOD)):
        feedback = feedback.after(vibrates, PERIOD)
    return feedback


def test_half_of_it_is_gone_within_a_second():
    feedback = after(Feedback(), True, 1.0)
    assert feedback.share == pytest.approx(HALF)
    assert feedback.count == 1


def test_all_of_it_is_gone_if_the_vibration_goes_on():
    feedback = after(Feedback(), True, FADE_TIME + HALF_TIME + 0.2)
    assert feedback.share == pytest.approx(0.0, abs=1e-9)
    assert not feedback.is_held


def test_a_vibration_without_feedback_holds_the_command():
    feedback = after(Feedback(), True, FADE_TIME + HALF_TIME + HOLD_AFTER + 0.5)
    assert feedback.is_held
    assert not after(feedback, False, 3.0).is_held


def test_it_returns_gradually_once_the_arm_is_calm():
    feedback = after(Feedback(), True, 1.0)
    waiting = after(feedback, False, CALM_TIME - 2 * PERIOD)
    assert waiting.share <= feedback.share
    shares = [after(waiting, False, seconds).share for seconds in (1.0, 2.0, 20.0)]
    assert waiting.share < shares[0] < shares[1] < shares[2]
    assert shares[2] == 1.0


def test_it_returns_to_less_after_every_further_vibration():
    feedback = Feedback()
    ceilings = []
    for _ in range(6):
        feedback = after(after(feedback, True, 1.0), False, 30.0)
        ceilings.append(feedback.share)
    assert ceilings[:4] == pytest.approx([1.0, 0.5, 0.25, 0.125])
    assert ceilings[4:] == pytest.approx([0.0, 0.0])


def test_a_controller_that_vibrates_is_recorded_and_then_held(puppet, actor, clock):
    """The actor ignores its feedback, as a user's controller may."""
    with Loop(puppet, actor, clock) as loop:
        steps = []
        for number in range(120):
            actor.share = 0.3 + 0.05 * (-1) ** number
            steps.append(loop.tick(StepRequest()))
        assert loop.feedback.count == 1
        commands = np.array([step.action for step in steps])
        still = np.ptp(commands[-15:], axis=0).max() == 0.0
        held = [np.ptp(commands[n : n + 10], axis=0).max() == 0.0 for n in range(110)]
        assert still or any(held)
        assert any("vibrate" in step.vibration for step in steps)
        assert steps[0].diagnostics["feedback"] == 1.0
        assert min(step.diagnostics["feedback"] for step in steps) == 0.0


def test_a_player_may_vibrate(puppet, actor, clock):
    with Loop(puppet, actor, clock, monitors_vibration=False) as loop:
        for number in range(60):
            actor.share = 0.3 + 0.05 * (-1) ** number
            loop.tick(StepRequest())
        assert loop.feedback == Feedback()
