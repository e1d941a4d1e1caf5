"""Average of the pose of a base that does not move before a camera that does not."""

import numpy as np

from s2c2a.lab.tracking.poses import Pose, are_near

MAX_FRAMES = 200  # of the average; after that, the newest replaces a 200th
MOVED_POSITION = 0.01  # m
MOVED_ROTATION = 0.05  # rad
MOVED_FRAMES = 5  # that agree that something moved


class BaseAverage:
    """Average pose of the base over many pictures.

    A pose far from the average is rejected. After five of them in a row the camera has
    moved, and the average begins again.
    """

    def __init__(self) -> None:
        """An average of nothing."""
        self.restarts = 0
        self._reset()

    def _reset(self) -> None:
        self.pose: Pose | None = None
        self._count = 0
        self._far = 0

    def update(self, measured: Pose | None) -> Pose | None:
        """Take the pose of one picture.

        Args:
            measured: `T_camera_base`; None if the base is not seen.

        Returns:
            The average; None before the first pose, and while the camera may have
            moved.
        """
        if measured is None:
            return self.pose if self._far == 0 else None
        if self.pose is None:
            self._take(measured)
        elif not are_near(measured, self.pose, MOVED_POSITION, MOVED_ROTATION):
            self._far += 1
            if self._far < MOVED_FRAMES:
                return None
            self._reset()
            self.restarts += 1
            self._take(measured)
            return self.pose
        else:
            self._far = 0
            self._take(measured)
        return self.pose

    def _take(self, measured: Pose) -> None:
        self._count = min(self._count + 1, MAX_FRAMES)
        before = self.pose or measured
        share = 1 / self._count
        position = before.position + share * (measured.position - before.position)
        # a quaternion and its negative are one rotation
        sign = 1.0 if before.rotation @ measured.rotation >= 0 else -1.0
        rotation = (1 - share) * before.rotation + share * sign * measured.rotation
        self.pose = Pose(position, rotation / np.linalg.norm(rotation))
