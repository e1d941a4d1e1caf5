"""Ends whose pose is only repeated, and arms that rest."""

import numpy as np
import pytest

from s2c2a.arm import ArmGeometry, load_arm
from s2c2a.lab.tracking import ModuleEnds, Pose, PoseFrame
from s2c2a.lab.tracking.frozen_bodies import FROZEN_CHANGE, RESPONSE, FrozenBodies

GEOMETRY = ArmGeometry.of(load_arm("twin_arm"))
NEUTRAL = GEOMETRY.action_neutral
PERIOD = 0.1
NO_TURN = np.array([0.0, 0.0, 0.0, 1.0])


class Stream:
    """Frames of three ends, of which some repeat their poses, and commands."""

    def __init__(self):
        self.bodies = FrozenBodies(ModuleEnds.of(3), GEOMETRY)
        self.random = np.random.default_rng(0)
        self.poses = {}
        self.number = 0

    def step(self, command, repeated=()):
        """Ends that are frozen in the next frame."""
        self.number += 1
        now = PERIOD * self.number
        for place, name in enumerate(("base", "end-1", "end-2", "end-3")):
            if name not in repeated:
                position = self.random.normal([0, 0, 0.2 * place], 1e-4)
                self.poses[name] = Pose(position, NO_TURN)
        self.bodies.sent(command, now - 0.01)
        frame = PoseFrame(now, now, self.number, dict(self.poses))
        return (np.flatnonzero(self.bodies.find(frame)) + 1).tolist()

    def steps(self, command, repeated=(), seconds=2.0):
        return [self.step(command, repeated) for _ in range(round(seconds / PERIOD))]


def pulled(module, share=0.5):
    command = NEUTRAL.copy()
    command[module - 1, 0] += share * GEOMETRY.action_scale[module - 1]
    return command


@pytest.fixture
def stream():
    stream = Stream()
    assert stream.steps(NEUTRAL) == [[]] * 20
    return stream


@pytest.mark.parametrize("module", [1, 2, 3])
def test_an_end_that_does_not_answer_its_cables_is_frozen(stream, module):
    name = f"end-{module}"
    stream.step(NEUTRAL, [name])
    found = stream.steps(pulled(module), [name])
    waiting = round(RESPONSE / PERIOD)
    assert found[:waiting] == [[]] * waiting
    assert found[waiting + 1 :] == [[module]] * (20 - waiting - 1)
    assert stream.step(pulled(module)) == []


def test_an_outer_end_must_answer_inner_cables_but_not_the_reverse(stream):
    assert stream.steps(pulled(1), ["end-3"])[-1] == [3]
    stream.step(NEUTRAL)
    assert stream.steps(pulled(3), ["end-1"]) == [[]] * 20


def test_ends_may_be_frozen_together(stream):
    assert stream.steps(pulled(1), ["end-1", "end-2", "end-3"])[-1] == [1, 2, 3]


def test_an_end_at_rest_may_repeat_its_pose(stream):
    """Digits hide the noise: a held command proves nothing."""
    for repeated in (["end-1"], ["end-1", "end-2", "end-3"]):
        assert stream.steps(NEUTRAL, repeated, seconds=10.0) == [[]] * 100


def test_an_end_may_rest_after_it_has_answered(stream):
    stream.steps(pulled(2), seconds=0.3)
    assert stream.steps(pulled(2), ["end-2"], seconds=10.0) == [[]] * 100


def test_commands_within_the_backlash_move_nothing(stream):
    for sign in (1, -1, 1, -1):
        small = pulled(2, 0.4 * sign * FROZEN_CHANGE)
        assert stream.steps(small, ["end-2"]) == [[]] * 20


def test_pulling_all_cables_of_a_module_bends_nothing(stream):
    tense = NEUTRAL + 0.3 * np.abs(GEOMETRY.action_scale)[:, None]
    assert stream.steps(tense, ["end-2"]) == [[]] * 20


def test_a_stream_that_repeats_all_bodies_is_an_arm_that_does_not_move(stream):
    everything = ["base", "end-1", "end-2", "end-3"]
    assert stream.steps(pulled(1), everything) == [[]] * 20


def test_a_lost_body_is_not_frozen(stream):
    del stream.poses["end-2"]
    assert stream.steps(pulled(2), ["end-2"]) == [[]] * 20


def test_after_a_restart_nothing_is_frozen(stream):
    stream.steps(pulled(2), ["end-2"])
    stream.bodies.reset()
    assert stream.step(pulled(2), ["end-2"]) == []
