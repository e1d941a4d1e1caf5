"""Accuracy of a webcam with tags, measured on painted pictures of a simulated arm."""

import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.execution.progress import Progress, quiet
from s2c2a.lab.emulation.plant import Plant
from s2c2a.lab.emulation.tag_camera import TagCamera, look_at
from s2c2a.lab.tracking.poses import Pose, angle_between
from s2c2a.lab.tracking.tags.camera import CameraModel
from s2c2a.lab.tracking.tags.detection import TagDropReason
from s2c2a.lab.tracking.tags.estimation import estimate_poses
from s2c2a.lab.tracking.tags.layout import BASE, TagLayout
from s2c2a.lab.tracking.tags.pictures import Effects

WRONG_POSITION = 0.02  # m
WRONG_ROTATION = np.radians(10)  # rad; an error beyond is a wrong pose
_SETTLING_TIME = 1.5  # s; from pose to pose
_SPEED = 1.0  # m/s
_TENSION = 200.0  # N
_BENDS = 0.9  # share of the full bend
_ELEVATIONS = np.radians((-10, 25))  # of the camera, seen from the arm
_FITS = 0.9  # share of the picture that base and tip may take
_STREAM = 23


@dataclass(frozen=True, eq=False)
class TagAccuracy:
    """Errors at one distance between camera and tip.

    Attributes:
        distance: of the tip from the camera [m].
        errors: of the tip's position in the camera frame [m], of its rotation [rad],
            and of its position in the base frame [m]; NaN where it was not measured.
        seconds: of every picture, for detection and poses [s].
        dropped: tags and bodies by reason.
    """

    distance: float
    errors: Float[np.ndarray, "pictures 3"]
    seconds: Float[np.ndarray, " pictures"]
    dropped: Counter[TagDropReason]

    @property
    def missing(self) -> float:
        """Share of the pictures without a pose of the tip."""
        return float(np.isnan(self.errors[:, 0]).mean())

    @property
    def wrong(self) -> int:
        """Number of tips that were measured wrong by more than 20 mm or 10 deg."""
        position, rotation, _ = self.errors.T
        return int(((position > WRONG_POSITION) | (rotation > WRONG_ROTATION)).sum())


def measure_accuracy(
    arm: ArmSpec,
    camera: CameraModel,
    layout: TagLayout,
    distances: Sequence[float],
    pictures: int = 50,
    effects: Effects | None = None,
    portrait: bool = False,
    seed: int = 0,
    progress: Progress = quiet,
) -> list[TagAccuracy]:
    """Measure poses of an arm at rest from all sides.

    Every picture shows another random bend of the arm. The camera stands in a random
    direction, at a given distance from the tip, and looks at the middle between base
    and tip, or at the tip if both do not fit the picture. No picture knows the one
    before: ambiguous poses are missing.

    Args:
        arm: that is measured.
        camera: its model.
        layout: of the tags.
        distances: between camera and tip [m].
        pictures: for each distance.
        effects: noise and blur.
        portrait: whether the camera is turned by 90 degrees.
        seed: of bends and directions.
        progress: called with the numbers of pictures done and in all.

    Raises:
        S2C2AError: the arm has tension actuation.
    """
    tags = TagCamera(camera, layout, arm)
    random = np.random.default_rng([seed, _STREAM])
    arms = _random_poses(arm, random)
    results: list[TagAccuracy] = []
    for distance in distances:
        result = TagAccuracy(
            distance, np.full((pictures, 3), np.nan), np.zeros(pictures), Counter()
        )
        for number in range(pictures):
            poses = next(arms)
            view = _view(poses[list(poses)[-1]], distance, camera, portrait, random)
            noise = replace(effects or Effects(), seed=number)
            image = tags.picture(poses, view, noise)
            start = time.perf_counter()
            found = estimate_poses(image, camera, layout)
            result.seconds[number] = time.perf_counter() - start
            result.dropped.update(found.dropped)
            result.errors[number] = _errors(found.poses, poses, view)
            done = len(results) * pictures + number + 1
            progress("pictures", done, len(distances) * pictures)
        results.append(result)
    return results


def _random_poses(
    arm: ArmSpec, random: np.random.Generator
) -> Iterator[dict[str, Pose]]:
    """Yield `T_base_body` of the arm at rest in random bends."""
    plant = Plant(arm, homed=True)
    geometry = ArmGeometry.of(arm)
    plant.targets.torque[:] = True
    plant.targets.speed[:] = _SPEED
    plant.targets.tension[:] = _TENSION
    while True:
        angles = random.uniform(0, 2 * np.pi, arm.module_count)
        amounts = _BENDS * np.sqrt(random.uniform(0, 1, arm.module_count))
        bends = amounts[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        actions = geometry.actions_at(bends)
        goals = np.clip(actions, geometry.action_low, geometry.action_high)
        plant.targets.goal[:] = goals.ravel()
        for _ in range(round(_SETTLING_TIME / plant.chunk)):
            plant.advance()
        yield {
            name: Pose(pose.position, pose.rotation)
            for name, pose in plant.poses().items()
        }


def _view(
    tip: Pose,
    distance: float,
    camera: CameraModel,
    portrait: bool,
    random: np.random.Generator,
) -> Pose:
    """`T_world_camera` in a random direction from the tip."""
    azimuth = random.uniform(0, 2 * np.pi)
    elevation = random.uniform(*_ELEVATIONS)
    flat = np.cos(elevation)
    direction = np.array(
        [flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)]
    )
    position = tip.position + distance * direction
    side = camera.width if portrait else camera.height
    seen = distance * side / camera.focal_lengths[0]
    fits = np.linalg.norm(tip.position) < _FITS * seen
    target = tip.position / 2 if fits else tip.position
    up = np.array([0.0, 0.0, 1.0])
    if portrait:
        up = np.cross(target - position, up)
    return look_at(position, target, up)


def _errors(
    found: Mapping[str, Pose], poses: Mapping[str, Pose], view: Pose
) -> tuple[float, float, float]:
    """Errors of the tip as in `TagAccuracy`."""
    tip = list(poses)[-1]
    if tip not in found:
        return np.nan, np.nan, np.nan
    true = view.inverse() @ poses[tip]
    in_base = np.nan
    if BASE in found:
        in_base = _distance(found[BASE].inverse() @ found[tip], poses[tip])
    rotation = angle_between(found[tip], true)
    return _distance(found[tip], true), rotation, in_base


def _distance(first: Pose, second: Pose) -> float:
    return float(np.linalg.norm(first.position - second.position))
