"""Control of the arm by requests, without a browser and without real time."""

from itertools import groupby

import numpy as np
import pytest

from s2c2a.episodes import load_episodes
from s2c2a.errors import SimulationError
from s2c2a.live.page import LivePage
from s2c2a.live.recorder import Recorder
from s2c2a.live.request import Obstacle
from s2c2a.spaces import POSITION, Stage

from held_clock import HeldClock  # type: ignore[import-not-found]


@pytest.fixture
def clock():
    """A clock that a test advances."""
    return HeldClock()


@pytest.fixture
def control(control, clock):
    """A running control, which waits for the clock."""
    yield control
    clock.release()


def drive(control, **changes):
    control.ask(driven=True, **changes)


def tip(control):
    return control.latest.states[-1, POSITION]


def test_the_tip_follows_the_target_and_holds_after_a_stop(control, clock):
    drive(control, target=(0.18, 0.05, 0.54))
    clock.until(lambda: control.latest.error < 0.05, what="arriving")
    control.ask(target=(-0.18, 0.05, 0.54))
    clock.until(lambda: tip(control)[0] < 0.15)
    control.ask(stopped=True)
    clock.until(lambda: control.latest.stage is Stage.HOLD)
    stopped = control.latest.step.number
    clock.until(
        lambda: control.latest.step.number > stopped + 30,
        what="the end of the vibration",
    )
    hold_position = tip(control)
    clock.until(lambda: control.latest.step.number > stopped + 35)
    assert np.linalg.norm(tip(control) - hold_position) < 0.01
    assert tip(control)[0] > -0.1
    missed = np.linalg.norm(np.subtract(control.request.target, tip(control)))
    assert abs(control.latest.error - missed) < 0.005


def test_the_arm_avoids_an_obstacle_that_is_moved_into_it(control, clock):
    drive(control, target=None, obstacles=(Obstacle((0.3, 0.0, 0.6), 0.1),))
    for x in np.linspace(0.3, 0.06, 25):
        control.ask(obstacles=(Obstacle((float(x), 0.0, 0.6), 0.1),))
        clock.advance(0.1)
    clock.until(lambda: control.latest.clearance > 0, what="clearance")
    assert np.linalg.norm(tip(control) - (0, 0, 0.6)) > 0.03


def test_a_task_is_played_paused_and_stepped(control, clock):
    drive(control, task="circle", playing=True, speed=4.0)
    clock.until(lambda: control.latest.task_step > 20)
    control.ask(playing=False)
    clock.advance(0.3)
    paused = control.latest.task_step
    control.step_task()
    clock.until(lambda: control.latest.task_step == paused + 1)
    control.restart_task()
    clock.until(lambda: control.latest.task_step == 0)


def test_payload_and_external_force_move_the_tip_and_end(control, clock):
    drive(control, stopped=True)
    control.ask(force=(1.0, 0.0, 0.0), payload=0.05)
    clock.until(lambda: tip(control)[0] > 0.01, what="deflection")
    control.ask(force=(0.0, 0.0, 0.0), payload=0.0)
    clock.until(lambda: abs(tip(control)[0]) < 0.01, what="return")


def test_a_robot_that_fails_is_stopped_until_it_is_reset(control, clock, monkeypatch):
    def fail(action):
        raise SimulationError("it blew up", 1)

    drive(control, target=(0.1, 0.0, 0.55))
    clock.until(lambda: control.latest.stage is Stage.RUN)
    monkeypatch.setattr(control._loop._robot.robot, "send", fail)
    clock.until(lambda: control.latest.stage is Stage.FAULT)
    assert "blew up" in control.latest.fault
    monkeypatch.undo()
    control.reset()
    clock.until(lambda: control.latest.stage is Stage.RUN)
    assert control.latest.fault == ""
    assert control.request.target == pytest.approx((0.0, 0.0, 0.6))  # at rest


def test_sensor_faults_do_not_stop_the_arm(control, clock):
    drive(control, target=(0.18, 0.0, 0.54), noise=0.05, coupling=1.0)
    clock.advance(1.5)
    assert np.isfinite(control.latest.states).all()
    assert control.latest.stage is Stage.RUN


def test_a_recording_can_be_loaded(control, clock, tmp_path):
    recorder = Recorder(control, tmp_path)
    drive(
        control, target=(0.15, 0.0, 0.55), obstacles=(Obstacle((0.3, 0.2, 0.6), 0.05),)
    )
    recorder.start()
    clock.advance(1.2)
    folder = recorder.stop()
    (episode,), _ = load_episodes(folder / "twin_arm.episodes")
    assert (episode.arm.name, episode.options["strategy"]) == ("twin_arm", "s2c2a")
    assert len(episode) == 12
    np.testing.assert_allclose(
        episode["desired_positions"][-1, -1], [0.15, 0.0, 0.55], atol=1e-6
    )
    assert episode["obstacles"].shape[1] == 1
    assert {"sensed", "planned", "predicted", "sensor.cables", "sensor.states"} <= set(
        episode.columns
    )
    assert (folder / "twin_arm.html").stat().st_size > 10_000
    assert recorder.stop() is None


def test_a_running_recording_is_saved_when_the_page_closes(control, clock, tmp_path):
    page = LivePage(control, 0, tmp_path / "runs")
    page._recorder.start()
    clock.advance(0.8)
    page.close()
    (folder,) = (tmp_path / "runs").iterdir()
    assert len(load_episodes(folder / "twin_arm.episodes")[0][0]) == 8


def test_an_arm_without_a_driver_holds_then_returns_to_rest(control, clock):
    stages = []
    drive(control, target=(0.15, 0.0, 0.55))
    clock.until(lambda: control.latest.error < 0.05, what="arriving")
    control.watch(lambda snapshot: stages.append(snapshot.stage))
    control.ask(driven=False)
    clock.until(lambda: Stage.IDLE in stages, what="rest")
    order = [stage for stage, _ in groupby(stages)]
    assert order[-3:] == [Stage.HOLD, Stage.RELEASE, Stage.IDLE]
    assert abs(stages.count(Stage.HOLD) - 20) <= 1  # two seconds
    clock.until(
        lambda: np.linalg.norm(tip(control) - (0, 0, 0.6)) < 0.02,
        what="the straight arm",
    )


def test_faulty_sensors_stop_the_arm_at_rest_until_it_is_reset(
    control, clock, monkeypatch
):
    drive(control, target=(0.15, 0.0, 0.55))
    clock.until(lambda: control.latest.error < 0.05, what="arriving")
    monkeypatch.setattr(
        control._loop, "_faults", lambda reading: type(reading)(reading.time, {})
    )
    clock.until(lambda: control.latest.stage is Stage.FAULT, what="giving up")
    assert control.latest.fault == "'cables' is missing"
    monkeypatch.undo()
    control.reset()
    clock.until(lambda: control.latest.stage is Stage.RUN)


def test_a_running_arm_returns_to_rest_when_its_control_stops(control, clock):
    drive(control, target=(0.15, 0.0, 0.55))
    clock.until(lambda: control.latest.error < 0.05, what="arriving")
    clock.release()
    control.stop()
    assert control.latest.stage is Stage.IDLE
    assert np.linalg.norm(tip(control) - (0, 0, 0.6)) < 0.05
