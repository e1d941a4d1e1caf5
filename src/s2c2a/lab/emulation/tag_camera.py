"""A camera that sees a simulated arm with tags."""

from collections.abc import Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from s2c2a.arm import ArmSpec
from s2c2a.lab.tracking.poses import Pose
from s2c2a.lab.tracking.tags.camera import CameraModel
from s2c2a.lab.tracking.tags.layout import TagLayout
from s2c2a.lab.tracking.tags.pictures import Effects, Lens, paint


class TagCamera:
    """A camera before an arm with tags."""

    def __init__(self, camera: CameraModel, layout: TagLayout, arm: ArmSpec):
        """Prepare the lens.

        Args:
            camera: its model.
            layout: of the tags.
            arm: as thick as its cables are apart.
        """
        self._lens = Lens(camera)
        self._layout = layout
        self._radius = min(module.cable_radius for module in arm.modules)

    def picture(
        self, poses: Mapping[str, Pose], view: Pose, effects: Effects | None = None
    ) -> np.ndarray:
        """Return a gray picture, 8 bit.

        Args:
            poses: `T_world_body` by name, from the base to the tip.
            view: `T_world_camera`.
            effects: blur and noise.
        """
        to_camera = view.inverse()
        seen = {name: to_camera @ pose for name, pose in poses.items()}
        ideal = paint(self._lens, self._layout, seen, self._radius)
        return self._lens.picture(ideal, effects)


def look_at(position, target, up=(0.0, 0.0, 1.0)) -> Pose:
    """Return `T_world_camera` of a camera that looks at a point.

    Args:
        position: of the camera [m], three numbers.
        target: in the middle of the picture [m].
        up: direction that is up in the picture; not along the view.
    """
    forward = np.subtract(target, position)
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, up)
    right = right / np.linalg.norm(right)
    axes = np.stack([right, np.cross(forward, right), forward], axis=1)
    return Pose(position, Rotation.from_matrix(axes).as_quat())
