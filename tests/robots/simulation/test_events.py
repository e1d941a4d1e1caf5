"""Events of the simulated robot: time, effect, validation, and reset by opening."""

import numpy as np
import pytest

from s2c2a.arm.sensors import Camera, Inertial, Sensors
from s2c2a.errors import S2C2AError
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.robots.simulation.events import EXAMPLE, parse_events

BENT = 0.3


def tips(robot, steps=12) -> np.ndarray:
    """Return the tip positions of an arm that bends and holds."""
    robot.open()
    action = robot._geometry.actions_at(np.full((3, 2), BENT))
    return np.array(
        [[robot.step(action), robot.states()[-1, :3]][1] for _ in range(steps)]
    )


@pytest.mark.parametrize(
    "kind", ["payload 0.1", "force 0.5 0 0", "homing_error 0.002", "stiffness_loss 0.9"]
)
def test_an_event_acts_at_its_time_and_not_before(twin, kind):
    calm = tips(SimulatedRobot(twin))
    troubled = tips(SimulatedRobot(twin, events=f"0.5 {kind}"))
    np.testing.assert_array_equal(calm[:5], troubled[:5])
    assert np.linalg.norm(calm[-1] - troubled[-1]) > 1e-3


def test_opening_again_undoes_all_events(twin):
    robot = SimulatedRobot(
        twin, events="0.5 payload 0.1; 0.5 stiffness_loss 0.5; 0.6 force 0.2 0 0"
    )
    np.testing.assert_array_equal(tips(robot), tips(robot))


def test_sensor_loss_leaves_encoders_and_ground_truth(twin):
    camera = Camera(rate=10.0, lost=0.0, delay=0.0)
    sensors = Sensors(imu=Inertial(), camera=camera)
    arm = twin.model_copy(update={"sensors": sensors})
    robot = SimulatedRobot(arm, events="0.3 sensor_loss")
    robot.open()
    said = []
    for _ in range(5):
        robot.step(robot._geometry.action_neutral)
        said.append(set(robot.read().sensors))
    assert {
        "accelerations",
        "angular_velocities",
        "camera_positions",
        "camera_age",
    } <= said[0]
    assert said[-1] == {"cables", "states", "configurations"}


@pytest.mark.parametrize(
    "text",
    [
        "payload 0.1",
        "8 payload",
        "8 melt 1",
        "-1 payload 0.1",
        "8 force 1 0",
        "8 stiffness_loss 1",
        "8 payload x",
    ],
)
def test_invalid_events_are_rejected(twin, text):
    with pytest.raises(S2C2AError, match="is not an event; write a time"):
        SimulatedRobot(twin, events=text)


def test_events_are_sorted_by_time():
    times = [one.time for one in parse_events("12 sensor_loss;" + EXAMPLE)]
    assert times == [8.0, 10.0, 12.0, 12.0]
