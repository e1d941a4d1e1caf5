"""Emergency stop: a switch, a signal, and a control loop that obeys them."""

import os
import signal
import threading

import numpy as np
import pytest

from s2c2a.runtime import Loop, StepRequest
from s2c2a.runtime.emergency import EmergencyStop, EmergencyStopError, stop_on_signal
from s2c2a.spaces import Stage


@pytest.fixture
def stop():
    return EmergencyStop()


@pytest.fixture
def loop(puppet, actor, clock, stop):
    """An open loop with a stop of its own, whose robot notes a halt."""
    puppet.halt = lambda: puppet.notes.append("halt")
    loop = Loop(puppet, actor, clock, emergency_stop=stop)
    loop.open()
    return loop


def test_a_switch_stays_on_until_it_is_reset(stop):
    stop.trigger("the red button")
    with pytest.raises(EmergencyStopError, match="by the red button; free the arm"):
        stop.check()
    stop.reset()
    stop.check()


def test_another_thread_can_stop_the_arm(stop):
    thread = threading.Thread(target=stop.trigger)
    thread.start()
    thread.join()
    assert stop.is_triggered


def test_a_signal_stops_the_arm_while_it_is_watched(stop):
    before = signal.getsignal(signal.SIGUSR1)
    with stop_on_signal(stop):
        os.kill(os.getpid(), signal.SIGUSR1)
        with pytest.raises(EmergencyStopError, match="SIGUSR1"):
            stop.check()
    assert signal.getsignal(signal.SIGUSR1) is before


def test_no_signal_is_watched_outside_the_main_thread(stop):
    before = signal.getsignal(signal.SIGUSR1)
    seen = []

    def watch():
        with stop_on_signal(stop):
            seen.append(signal.getsignal(signal.SIGUSR1))

    thread = threading.Thread(target=watch)
    thread.start()
    thread.join()
    assert seen == [before]


def test_no_command_follows_an_emergency_stop(loop, puppet, stop):
    for _ in range(5):
        loop.tick(StepRequest())
    stop.trigger()
    count = len(puppet.sent)
    with pytest.raises(EmergencyStopError):
        loop.tick(StepRequest())
    loop.close()
    assert len(puppet.sent) == count
    assert puppet.notes == ["open", "halt", "close"]
    assert not np.allclose(puppet.position, puppet.geometry.action_neutral)


def test_a_stop_during_a_step_ends_the_next_one(loop, puppet, actor, stop):
    actor.before_step = lambda number: number == 3 and stop.trigger()
    for _ in range(4):
        loop.tick(StepRequest())
    with pytest.raises(EmergencyStopError):
        loop.tick(StepRequest())
    assert len(puppet.sent) == 4
    assert loop.phase.stage is Stage.FAULT


def test_an_arm_on_its_way_to_rest_stops_too(loop, puppet, stop):
    for _ in range(5):
        loop.tick(StepRequest())
    steps = loop.to_rest()
    next(steps)
    stop.trigger()
    count = len(puppet.sent)
    with pytest.raises(EmergencyStopError):
        next(steps)
    loop.close()
    assert len(puppet.sent) == count


def test_an_arm_opens_only_after_the_stop_was_reset(loop, puppet, stop):
    stop.trigger()
    with pytest.raises(EmergencyStopError):
        loop.open()
    assert puppet.notes == ["open"]
    stop.reset()
    loop.open()
    assert loop.tick(StepRequest()).stage is Stage.RUN


def test_a_stop_just_before_the_end_does_not_move_the_arm(loop, puppet, stop):
    for _ in range(5):
        loop.tick(StepRequest())
    count = len(puppet.sent)
    stop.trigger()
    loop.close()
    assert len(puppet.sent) == count
    assert puppet.notes == ["open", "halt", "close"]
