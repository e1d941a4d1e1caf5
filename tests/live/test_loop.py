"""The control loop, without a browser."""

import time

import numpy as np

from s2c2a.errors import SimulationError
from s2c2a.live.recorder import Recorder
from s2c2a.live.snapshot import Stage
from s2c2a.live.wish import Obstacle
from s2c2a.spaces import POSITION
from s2c2a.viz.trace_files import TRACES, load_traces

from live_tabs import until  # type: ignore[import-not-found]


def driven(loop, **changes):
    loop.ask(driven=True, **changes)
    return loop


def tip(loop):
    return loop.latest.states[-1, POSITION]


def test_the_tip_follows_the_target_and_stops_where_it_is_told_to(loop):
    driven(loop, target=(0.18, 0.05, 0.54))
    until(lambda: loop.latest.error < 0.01, what="arriving")
    loop.ask(target=(-0.18, 0.05, 0.54))
    until(lambda: tip(loop)[0] < 0.1)
    loop.ask(stopped=True)
    until(lambda: loop.latest.stage is Stage.HOLDING)
    stopped = loop.latest.number
    until(lambda: loop.latest.number > stopped + 30, what="the end of its swing")
    held = tip(loop)
    until(lambda: loop.latest.number > stopped + 35)
    assert np.linalg.norm(tip(loop) - held) < 0.01
    assert tip(loop)[0] > -0.1


def test_an_obstacle_pushed_into_the_arm_makes_it_flee(loop):
    driven(loop, target=None, obstacles=(Obstacle((0.3, 0.0, 0.6), 0.1),))
    for x in np.linspace(0.3, 0.06, 25):
        loop.ask(obstacles=(Obstacle((float(x), 0.0, 0.6), 0.1),))
        time.sleep(0.1)
    until(lambda: loop.latest.clearance > 0, what="fleeing")
    assert np.linalg.norm(tip(loop) - (0, 0, 0.6)) > 0.03


def test_a_task_is_played_paused_and_stepped(loop):
    driven(loop, task="circle", playing=True, speed=4.0)
    until(lambda: loop.latest.task_step > 20)
    loop.ask(playing=False)
    time.sleep(0.3)
    waiting = loop.latest.task_step
    loop.step_task()
    until(lambda: loop.latest.task_step == waiting + 1)
    loop.restart_task()
    until(lambda: loop.latest.task_step == 0)


def test_payload_and_push_act_and_end(loop):
    driven(loop, stopped=True)
    loop.ask(push=(1.0, 0.0, 0.0), payload=0.05)
    until(lambda: tip(loop)[0] > 0.01, what="giving way")
    loop.ask(push=(0.0, 0.0, 0.0), payload=0.0)
    until(lambda: abs(tip(loop)[0]) < 0.01, what="coming back")


def test_a_body_that_fails_stands_still_until_it_is_reset(loop, monkeypatch):
    def broken(action):
        raise SimulationError("it blew up", 1)

    driven(loop, target=(0.1, 0.0, 0.55))
    until(lambda: loop.latest.stage is Stage.DRIVEN)
    monkeypatch.setattr(loop._robot, "send", broken)
    until(lambda: loop.latest.stage is Stage.FAILED)
    assert "blew up" in loop.latest.fault
    monkeypatch.undo()
    loop.reset()
    until(lambda: loop.latest.stage is Stage.DRIVEN)
    assert loop.latest.fault == ""


def test_sensor_faults_spoil_what_is_sensed_and_nothing_else(loop):
    driven(loop, target=(0.18, 0.0, 0.54), noise=0.05, coupling=1.0)
    time.sleep(1.5)
    assert np.isfinite(loop.latest.states).all()
    assert loop.latest.stage is Stage.DRIVEN


def test_what_is_recorded_can_be_read_back(loop, tmp_path):
    recorder = Recorder(loop, tmp_path)
    driven(loop, target=(0.15, 0.0, 0.55), obstacles=(Obstacle((0.3, 0.2, 0.6), 0.05),))
    recorder.start()
    time.sleep(1.2)
    folder = recorder.stop()
    traces, arm = load_traces(folder / f"twin_arm.{TRACES}")
    assert arm.name == "twin_arm"
    assert 8 <= traces[0].times.size <= 14
    np.testing.assert_allclose(traces[0].wanted_positions[-1, -1], [0.15, 0.0, 0.55], atol=1e-6)
    assert traces[0].obstacles.shape[1] == 1
    assert (folder / "twin_arm.html").stat().st_size > 10_000
    assert recorder.stop() is None
