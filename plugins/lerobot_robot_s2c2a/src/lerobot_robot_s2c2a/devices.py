"""The robot and the teleoperator, as LeRobot calls them."""

from typing import Any

from lerobot.robots import Robot
from lerobot.teleoperators import Teleoperator
from lerobot.utils.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError

from s2c2a.errors import S2C2AError

from lerobot_robot_s2c2a.arm import DrivenArm, open_arm
from lerobot_robot_s2c2a.configs import S2C2AExpertConfig, S2C2ARobotConfig
from lerobot_robot_s2c2a.expert import Expert

CONNECTED: dict[str | None, DrivenArm] = {}
"""Connected arms by the id of their robot: LeRobot shows a teleoperator no readings."""


class S2C2ARobot(Robot):
    """An arm in the control loop of S2C2A; every frame is a control step."""

    config_class = S2C2ARobotConfig
    name = "s2c2a"

    def __init__(self, config: S2C2ARobotConfig):
        super().__init__(config)
        self.config = config
        self.cameras: dict[str, Any] = {}  # LeRobot counts them
        self._arm = open_arm(
            config.arm,
            config.robot,
            tuple(config.robot_option),
            config.tracking,
            tuple(config.sensors),
            config.action_space,
            config.weights,
        )
        self._is_connected = False

    @property
    def observation_features(self) -> dict[str, type]:
        return dict.fromkeys(self._arm.sensor_names, float)

    @property
    def action_features(self) -> dict[str, type]:
        return dict.fromkeys(self._arm.action_names, float)

    @property
    def is_connected(self) -> bool:
        return self._is_connected

    @property
    def is_calibrated(self) -> bool:
        """Always; `s2c2a motors home` calibrates servos."""
        return True

    def connect(self, calibrate: bool = True) -> None:
        if self._is_connected:
            raise DeviceAlreadyConnectedError(f"{self} is already connected")
        self._arm.open()
        self._is_connected = True
        CONNECTED[self.id] = self._arm

    def calibrate(self) -> None:
        """Do nothing; `s2c2a motors home` calibrates servos."""

    def configure(self) -> None:
        """Do nothing; the arm file configures servos."""

    def get_observation(self) -> dict[str, float]:
        self._check_connected()
        return self._arm.observe()

    def send_action(self, action: dict[str, Any]) -> dict[str, float]:
        self._check_connected()
        return self._arm.step(action)

    def disconnect(self) -> None:
        self._check_connected()
        self._is_connected = False
        CONNECTED.pop(self.id, None)
        self._arm.close()

    def _check_connected(self) -> None:
        if not self._is_connected:
            raise DeviceNotConnectedError(f"{self} is not connected; call connect()")


class S2C2AExpert(Teleoperator):
    """A strategy that shows a task; it needs no device and no display."""

    config_class = S2C2AExpertConfig
    name = "s2c2a_expert"

    def __init__(self, config: S2C2AExpertConfig):
        super().__init__(config)
        self.config = config
        self._expert: Expert | None = None

    @property
    def action_features(self) -> dict[str, type]:
        return dict.fromkeys(self._connected_arm().action_names, float)

    @property
    def feedback_features(self) -> dict[str, type]:
        return {}

    @property
    def is_connected(self) -> bool:
        return self._expert is not None

    @property
    def is_calibrated(self) -> bool:
        """Always; there is nothing to calibrate."""
        return True

    def connect(self, calibrate: bool = True) -> None:
        arm = self._connected_arm()
        self._expert = Expert(arm, self.config.task, self.config.weights)

    def calibrate(self) -> None:
        """Do nothing."""

    def configure(self) -> None:
        """Do nothing."""

    def get_action(self) -> dict[str, float]:
        if self._expert is None:
            raise DeviceNotConnectedError(f"{self} is not connected; call connect()")
        return self._expert.action()

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Do nothing."""

    def disconnect(self) -> None:
        self._expert = None

    def _connected_arm(self) -> DrivenArm:
        if self.id not in CONNECTED:
            raise S2C2AError(
                f"no robot s2c2a with the id {self.id} is connected in this program; "
                "connect it first, and give --teleop.id and --robot.id alike"
            )
        return CONNECTED[self.id]
