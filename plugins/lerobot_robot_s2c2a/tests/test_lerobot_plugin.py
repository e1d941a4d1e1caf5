"""The plug-in in LeRobot itself; it runs in an environment with LeRobot."""

import numpy as np
import pytest

pytest.importorskip("lerobot", reason="LeRobot is not installed: see README.md")

from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.robots import make_robot_from_config
from lerobot.scripts.lerobot_record import DatasetRecordConfig, RecordConfig, record
from lerobot.scripts.lerobot_replay import DatasetReplayConfig, ReplayConfig, replay
from lerobot.utils.errors import DeviceNotConnectedError

import lerobot_robot_s2c2a
from lerobot_robot_s2c2a import S2C2AExpertConfig, S2C2ARobot, S2C2ARobotConfig

RATE = 10  # Hz, of twin_arm


def test_a_robot_is_made_from_its_configuration(tmp_path):
    robot = make_robot_from_config(S2C2ARobotConfig(calibration_dir=tmp_path))
    assert isinstance(robot, S2C2ARobot)
    assert set(robot.action_features.values()) == {float}
    with pytest.raises(DeviceNotConnectedError):
        robot.get_observation()


@pytest.mark.parametrize("action_space", ["cables", "tip"])
def test_a_replay_moves_the_arm_as_in_the_recording(
    action_space, tmp_path, monkeypatch
):
    robot = S2C2ARobotConfig(action_space=action_space, calibration_dir=tmp_path)
    root = tmp_path / "set"
    given = DatasetRecordConfig(
        "me/set", "reach a point", root, RATE, 3, 0, 1, video=False, push_to_hub=False
    )
    expert = S2C2AExpertConfig(task="circle", calibration_dir=tmp_path)
    record(RecordConfig(robot, given, expert, play_sounds=False))
    recorded = LeRobotDataset("me/set", root=root)
    seen = []
    observe = S2C2ARobot.get_observation

    def watched(self):
        seen.append(observe(self))
        return seen[-1]

    monkeypatch.setattr(lerobot_robot_s2c2a.S2C2ARobot, "get_observation", watched)
    chosen = DatasetReplayConfig("me/set", 0, root)
    replay(ReplayConfig(robot, chosen, play_sounds=False))
    states = np.array([frame["observation.state"] for frame in recorded.hf_dataset])
    again = np.array([list(observation.values()) for observation in seen])
    assert np.ptp(states, axis=0).max() > 0.003
    np.testing.assert_allclose(again, states, atol=2e-4)
