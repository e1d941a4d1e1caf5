"""`live --robot FILE:Class`: a robot without a simulation."""

import pickle
from pathlib import Path

import pytest

from s2c2a.cli.execution import robot_factory_for
from s2c2a.live.control import ArmControl
from s2c2a.live.page import MODEL_DRAWN, LivePage
from s2c2a.live.recorder import Recorder
from s2c2a.spaces import Stage

from held_clock import HeldClock  # type: ignore[import-not-found]


def test_an_arm_without_measured_states_is_drawn_as_predicted_and_recorded(
    twin, strategy, tmp_path
):
    robot = robot_factory_for(
        f"{Path(__file__).with_name('blind_arm.py')}:BlindArm",
        ("port=/dev/ttyUSB0", "baud=115200"),
    )
    # as `live` hands it to the process of the control
    robot = pickle.loads(pickle.dumps(robot))
    clock = HeldClock()
    blind_arm = robot.make(twin, seed=0)
    blind_arm.now = clock.now
    control = ArmControl(blind_arm, {"s2c2a": lambda: strategy}, {}, 2.0, clock)
    control.start()
    page = LivePage(control, 0, tmp_path)
    assert control.limits.payload == control.limits.force == 0.0
    assert MODEL_DRAWN in page._status_of(control.latest)
    recorder = Recorder(control, tmp_path)
    recorder.start()
    control.ask(
        driven=True, target=(0.15, 0.0, 0.55), payload=9.0, force=(9.0, 0.0, 0.0)
    )
    clock.until(
        lambda: control.latest.stage is Stage.RUN and control.latest.error < 0.02,
        what="the model's arrival",
    )
    assert control.latest.states[-1, 0] == pytest.approx(0.15, abs=0.03)
    folder = recorder.stop()
    clock.release()
    page.close()
    control.stop()
    assert (folder / "twin_arm.episodes").is_file()
    assert not (folder / "twin_arm.html").exists()
