"""A simulated robot whose tags are detected in painted pictures."""

from collections import deque
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError
from s2c2a.lab.emulation.plant import end_poses
from s2c2a.lab.emulation.tag_camera import TagCamera, look_at
from s2c2a.lab.tracking.poses import Pose
from s2c2a.lab.tracking.tags.base_average import BaseAverage
from s2c2a.lab.tracking.tags.camera import CameraModel
from s2c2a.lab.tracking.tags.estimation import estimate_poses
from s2c2a.lab.tracking.tags.layout import BASE, TagLayout
from s2c2a.lab.tracking.tags.pictures import Effects
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.spaces import Reading

WIDTH = 1280  # pixels
HEIGHT = 720  # pixels
FIELD = 60.0  # deg
NOISE = 2.0  # gray values
BLUR = 0.6  # pixels
HEIGHT_SHARE = 0.5  # of the arm's length, at which the camera looks
CAMERA_VALUES = ("camera_positions", "camera_age")


class TagCameraRobot(SimulatedRobot):
    """A simulated robot that measures its ends by tags in painted pictures.

    The table `[sensors.camera]` gives the rate and the age of the pictures, and which
    ends are seen; noise and losses are those of the pictures. The estimator gets what
    a `TagTracker` would find.

    Args:
        arm: with a table `[sensors.camera]`.
        fidelity: of the simulation.
        seed: of noise.
        payload: mass at the tip [kg].
        distance: of the camera from the arm [m].
        azimuth_deg: direction to the camera, from x to y [deg].

    Raises:
        S2C2AError: the arm has no camera.
    """

    _last_time: float

    def __init__(
        self,
        arm: ArmSpec,
        fidelity: str = "fast",
        seed: int = 0,
        payload: float = 0.0,
        distance: float = 1.0,
        azimuth_deg: float = 45.0,
    ):
        super().__init__(arm, fidelity, seed, payload)
        if arm.sensors.camera is None:
            raise S2C2AError(
                f"'{arm.name}' has no table [sensors.camera]; add it to the arm file"
            )
        self._settings = arm.sensors.camera
        self._camera = CameraModel.of_field(WIDTH, HEIGHT, FIELD)
        self._layout = TagLayout.collars(arm.module_count)
        self._tags = TagCamera(self._camera, self._layout, arm)
        # `T_world_camera` of an upright camera that is turned to portrait
        azimuth = np.deg2rad(azimuth_deg)
        target = np.array([0.0, 0.0, HEIGHT_SHARE * arm.length])
        direction = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
        self._view = look_at(target + distance * direction, target, right)
        self._start_pictures()

    def open(self) -> Reading:
        self._start_pictures()
        return super().open()

    def read(self) -> Reading:
        """See `Robot`; the camera's values are those that the tags give."""
        reading = super().read()
        values = dict(reading.sensors)
        for name in CAMERA_VALUES:
            values.pop(name, None)
        if reading.time > self._last_time:
            self._last_time = reading.time
            self._expose(reading.time)
            values |= self._arrived(reading.time)
        return replace(reading, sensors=values)

    def _start_pictures(self) -> None:
        self._last_time = -np.inf
        self._next_exposure = 0.0
        self._pictures: deque[tuple[float, np.ndarray]] = deque()
        self._base = BaseAverage()
        self._previous: dict[str, Pose] = {}

    def _expose(self, now: float) -> None:
        """Take a picture if one is due, and find its tags."""
        if now < self._next_exposure:
            return
        self._next_exposure += 1.0 / self._settings.rate
        effects = Effects(NOISE, BLUR, seed=int(1e6 * now))
        true = end_poses(self.data, self.arm.module_count)
        poses = {name: Pose(one.position, one.rotation) for name, one in true.items()}
        image = self._tags.picture(poses, self._view, effects)
        found = estimate_poses(image, self._camera, self._layout, self._previous)
        self._previous = dict(found.poses)
        self._pictures.append((now, self._positions(found.poses)))

    def _positions(self, poses: Mapping[str, Pose]) -> np.ndarray:
        """Positions of the ends in the base frame [m]; NaN where they are not found."""
        positions = np.full((self.arm.module_count, 3), np.nan)
        base = self._base.update(poses.get(BASE))
        first = self.arm.module_count - 1 if self._settings.sees == "tip" else 0
        for module in range(first, self.arm.module_count):
            end = poses.get(f"end-{module + 1}")
            if base is not None and end is not None:
                positions[module] = (base.inverse() @ end).position
        return positions

    def _arrived(self, now: float) -> dict[str, np.ndarray]:
        """Return the newest picture whose delay is over, once."""
        values: dict[str, np.ndarray] = {}
        while self._pictures and now - self._pictures[0][0] >= self._settings.delay:
            exposure, positions = self._pictures.popleft()
            age = np.asarray(now - exposure)
            values = {"camera_positions": positions, "camera_age": age}
        return values
