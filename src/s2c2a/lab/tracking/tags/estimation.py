"""Poses of bodies from the tags in one picture; pure functions."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from s2c2a.lab.tracking.poses import Pose, angle_between, are_near
from s2c2a.lab.tracking.tags.camera import CameraModel
from s2c2a.lab.tracking.tags.detection import (
    TagDropReason,
    TagError,
    TagView,
    detect_tags,
)
from s2c2a.lab.tracking.tags.layout import Tag, TagLayout, square
from s2c2a.lab.tracking.tags.opencv import cv2

MAX_ERROR = 1.0  # pixels; rms distance of the corners from those of the pose
CORNER_NOISE = 0.1  # pixels; standard deviation that precision is computed with
MAX_POSITION_STD = 0.012  # m
MAX_ROTATION_STD = 0.05  # rad
_SAME_POSITION = 0.002  # m; between two solutions that are one
_SAME_ROTATION = 0.05  # rad
_AMBIGUITY_RATIO = 2.5  # of the errors of two poses, below which either may be right
_AMBIGUITY_FLOOR = 0.2  # pixels; a pose with less error may be right in any case
_ROUGH_ERROR = 2.5  # pixels; largest error of a rough tag where the pose is right
_ROUGH_RATIO = 3.0  # of its errors for the other pose and the right one
_CONTINUITY = 0.5  # distance of a pose from the previous one over that of its rival
_MAX_TURN = 0.6  # rad; since the previous pose


@dataclass(frozen=True, eq=False)
class TagPoses:
    """Result of one picture.

    Attributes:
        poses: `T_camera_body` by name; a body that is not seen is absent.
        views: tags that were used or could have been.
        dropped: numbers of dropped tags and bodies by reason.
    """

    poses: Mapping[str, Pose]
    views: Sequence[TagView]
    dropped: Mapping[TagDropReason, int]


@dataclass(frozen=True, eq=False)
class PoseCandidate:
    """A pose that may be right.

    Attributes:
        pose: `T_camera_body`.
        error: rms distance of the corners [pixels].
        distances: of every corner [pixels].
    """

    pose: Pose
    error: float
    distances: Float[np.ndarray, " corners"]


def estimate_poses(
    image: np.ndarray,
    camera: CameraModel,
    layout: TagLayout,
    previous: Mapping[str, Pose] | None = None,
) -> TagPoses:
    """Estimate the poses of all bodies that carry tags.

    The pose of a body minimizes the distances of all corners of its visible tags. One
    tag alone often leaves two poses; then a blurred or partly covered tag of the body
    decides, or else the previous pose, or the body is absent.

    Args:
        image: 8 bit, shape (height, width) or (height, width, 3) in the order blue,
            green, red.
        camera: model of the camera.
        layout: of the tags.
        previous: recent `T_camera_body` by name.

    Raises:
        TagError: the image is malformed, or not of the size of the camera model.
    """
    is_image = isinstance(image, np.ndarray) and image.dtype == np.uint8
    is_image = is_image and image.ndim in (2, 3)
    if not is_image or image.shape[2:] not in ((), (3,)):
        raise TagError(TagDropReason.MALFORMED)
    if image.shape[:2] != (camera.height, camera.width):
        height, width = image.shape[:2]
        raise TagError(
            TagDropReason.WRONG_SIZE,
            f"the pictures have {width} x {height} pixels, the camera model "
            f"{camera.width} x {camera.height}; calibrate with the size that is used",
        )
    gray = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    tags = layout.by_id
    found = detect_tags(gray, tags)
    poses = {}
    for body in layout.bodies:
        views = [view for view in found.views if tags[view.id].body == body]
        rough = [view for view in found.rough if tags[view.id].body == body]
        if not views:
            continue
        before = (previous or {}).get(body)
        try:
            poses[body] = _body_pose(views, rough, tags, camera, before, found.dropped)
        except TagError as error:
            found.dropped[error.reason] += 1
    return TagPoses(poses, found.views, found.dropped)


def _body_pose(
    views: list[TagView],
    rough: list[TagView],
    tags: Mapping[int, Tag],
    camera: CameraModel,
    before: Pose | None,
    dropped: Counter[TagDropReason],
) -> Pose:
    """Return `T_camera_body`, without the tags that disagree with the others."""
    while True:
        best, *rivals = _candidates(views, tags, camera)
        if best.error <= MAX_ERROR:
            break
        if len(views) == 1:
            raise TagError(TagDropReason.MISFIT)
        errors = best.distances.reshape(-1, 4).max(axis=1)
        worst = int(errors.argmax())
        views = views[:worst] + views[worst + 1 :]
        dropped[TagDropReason.MISFIT] += 1
    limit = max(_AMBIGUITY_RATIO * best.error, _AMBIGUITY_FLOOR)
    possible = [best, *(rival for rival in rivals if rival.error < limit)]
    chosen = _choose_by_rough(possible, rough, tags, camera)
    pose = chosen or _choose_by_previous(possible, before)
    # refuse a pose that the noise of the corners moves too far
    model = _corners(views, tags)
    # about the center of the tags: a rotation about a far origin would move them
    center = model.mean(axis=0)
    centered = Pose(pose.position + pose.matrix @ center, pose.rotation)
    _, jacobian = _project(centered, model - center, camera)
    information = jacobian.T @ jacobian / CORNER_NOISE**2
    try:
        deviations = np.sqrt(np.diag(np.linalg.inv(information)))
    except np.linalg.LinAlgError as error:
        raise TagError(TagDropReason.IMPRECISE) from error
    is_turned = np.linalg.norm(deviations[:3]) > MAX_ROTATION_STD
    if is_turned or np.linalg.norm(deviations[3:]) > MAX_POSITION_STD:
        raise TagError(TagDropReason.IMPRECISE)
    return pose


def _corners(views: Sequence[TagView], tags: Mapping[int, Tag]) -> np.ndarray:
    """Corners of tags in the body frame [m], shape (4 tags, 3)."""
    return np.concatenate([tags[view.id].corners for view in views])


def _candidates(
    views: Sequence[TagView], tags: Mapping[int, Tag], camera: CameraModel
) -> list[PoseCandidate]:
    """Distinct poses from both solutions of every tag, the best first."""
    model = _corners(views, tags)
    pixels = np.concatenate([view.corners for view in views])
    found = []
    for view in views:
        tag = tags[view.id]
        for start in _square_poses(view, tag.size, camera):
            body = start @ tag.pose.inverse()
            found.append(_refined(body, model, pixels, camera))
    usable = [one for one in found if one is not None]
    if not usable:
        raise TagError(TagDropReason.MISFIT)
    distinct: list[PoseCandidate] = []
    for candidate in sorted(usable, key=lambda one: one.error):
        known = (
            are_near(candidate.pose, one.pose, _SAME_POSITION, _SAME_ROTATION)
            for one in distinct
        )
        if not any(known):
            distinct.append(candidate)
    return distinct


def _square_poses(view: TagView, size: float, camera: CameraModel) -> list[Pose]:
    """`T_camera_tag`, both solutions of a single tag."""
    _, rotations, positions, _ = cv2.solvePnPGeneric(
        square(size),
        view.corners,
        camera.matrix,
        camera.coefficients,
        flags=cv2.SOLVEPNP_IPPE_SQUARE,
    )
    pairs = zip(rotations, positions, strict=True)
    return [
        _pose(rotation, position)
        for rotation, position in pairs
        if np.isfinite([rotation, position]).all()
    ]


def _pose(rotation_vector: np.ndarray, position: np.ndarray) -> Pose:
    quaternion = Rotation.from_rotvec(np.ravel(rotation_vector)).as_quat()
    return Pose(np.ravel(position), quaternion)


def _refined(
    start: Pose, model: np.ndarray, pixels: np.ndarray, camera: CameraModel
) -> PoseCandidate | None:
    """Minimize the distances of all corners; None without a pose before the camera."""
    vector = Rotation.from_quat(start.rotation).as_rotvec()
    vector, position = cv2.solvePnPRefineLM(
        model,
        pixels,
        camera.matrix,
        camera.coefficients,
        vector.reshape(3, 1),
        start.position.reshape(3, 1).copy(),
    )
    is_known = np.isfinite([vector, position]).all()
    if not is_known or np.abs(position).max() > 100:
        return None
    pose = _pose(vector, position)
    depths = (model @ pose.matrix.T + pose.position)[:, 2]
    if depths.min() <= 0:
        return None
    projected, _ = _project(pose, model, camera)
    distances = np.linalg.norm(projected - pixels, axis=1)
    return PoseCandidate(pose, float(np.sqrt(np.mean(distances**2))), distances)


def _project(
    pose: Pose, points: np.ndarray, camera: CameraModel
) -> tuple[np.ndarray, np.ndarray]:
    """Pixels of points, and their derivatives by rotation vector and position."""
    vector = Rotation.from_quat(pose.rotation).as_rotvec()
    projected, jacobian = cv2.projectPoints(
        points, vector, pose.position, camera.matrix, camera.coefficients
    )
    return projected.reshape(-1, 2), jacobian[:, :6]


def _choose_by_rough(
    possible: list[PoseCandidate],
    rough: list[TagView],
    tags: Mapping[int, Tag],
    camera: CameraModel,
) -> Pose | None:
    """Choose the pose that has the rough tags where they are; None if unclear."""
    if len(possible) == 1:
        return possible[0].pose
    if not rough:
        return None
    model = _corners(rough, tags)
    pixels = np.concatenate([view.corners for view in rough])
    errors = []
    for candidate in possible:
        projected, _ = _project(candidate.pose, model, camera)
        distances = np.linalg.norm(projected - pixels, axis=1)
        errors.append(float(np.sqrt(np.mean(distances**2))))
    first, second = np.argsort(errors)[:2]
    is_right = errors[first] < _ROUGH_ERROR
    if is_right and errors[second] > _ROUGH_RATIO * errors[first]:
        return possible[first].pose
    return None


def _choose_by_previous(possible: list[PoseCandidate], before: Pose | None) -> Pose:
    """Choose the pose that is near the previous one.

    Raises:
        TagError: there is none, or it does not decide.
    """
    if before is None:
        raise TagError(TagDropReason.AMBIGUOUS)
    turns = [angle_between(one.pose, before) for one in possible]
    first, second = np.argsort(turns)[:2]
    if turns[first] > min(_MAX_TURN, _CONTINUITY * turns[second]):
        raise TagError(TagDropReason.AMBIGUOUS)
    return possible[first].pose
