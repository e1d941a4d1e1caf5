"""A simulated robot whose camera is rendered."""

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.arm.sensors import Camera, Sensors
from s2c2a.errors import S2C2AError
from s2c2a.lab.emulation.tag_robot import TagCameraRobot
from s2c2a.spaces import POSITION

ARM = load_arm("twin_arm")
CAMERA = Camera(rate=10.0, delay=0.1, sees="tip")


@pytest.mark.slow
def test_the_tip_is_measured_by_its_tags_and_late():
    arm = ARM.model_copy(update={"sensors": Sensors(camera=CAMERA)})
    with TagCameraRobot(arm) as robot:
        at_exposure = robot.open()["states"]
        robot.advance(arm.control_period)
        reading = robot.read()
        again = robot.read()
    positions = reading["camera_positions"]
    assert np.isnan(positions[:2]).all()
    np.testing.assert_allclose(positions[2], at_exposure[2, POSITION], atol=0.003)
    assert reading["camera_age"] == pytest.approx(0.1)
    assert "camera_positions" not in again.sensors


def test_an_arm_without_a_camera_is_refused():
    with pytest.raises(S2C2AError, match=r"no table \[sensors.camera\]"):
        TagCameraRobot(ARM)
