"""`live --robot FILE:Class`: a robot without a simulation."""

from pathlib import Path

import pytest

from s2c2a.cli.execution import robot_factory_for
from s2c2a.live.cli.live import running_page
from s2c2a.live.page import MODEL_DRAWN
from s2c2a.live.recorder import Recorder
from s2c2a.spaces import Stage

from live_tabs import until  # type: ignore[import-not-found]


def test_an_arm_without_measured_states_is_drawn_as_predicted_and_recorded(tmp_path):
    robot = robot_factory_for(
        f"{Path(__file__).with_name('blind_arm.py')}:BlindArm",
        ("port=/dev/ttyUSB0", "baud=115200"),
    )
    with running_page("twin_arm", factory=robot, port=0, out=tmp_path) as (
        control,
        page,
    ):
        until(lambda: MODEL_DRAWN in page._status.content, what="the notice")
        assert control.limits.payload == control.limits.force == 0.0
        recorder = Recorder(control, tmp_path)
        recorder.start()
        control.ask(
            driven=True, target=(0.15, 0.0, 0.55), payload=9.0, force=(9.0, 0.0, 0.0)
        )
        until(
            lambda: control.latest.stage is Stage.RUN and control.latest.error < 0.02,
            what="the model's arrival",
        )
        assert control.latest.states[-1, 0] == pytest.approx(0.15, abs=0.03)
        folder = recorder.stop()
        assert (folder / "twin_arm.episodes").is_file()
        assert not (folder / "twin_arm.html").exists()
