"""Accuracy of a webcam with tags, measured on rendered pictures of a simulated arm."""

import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.lab.emulation.plant import Plant
from s2c2a.lab.emulation.tag_camera import TagScene, look_at
from s2c2a.lab.tracking.poses import Pose, angle_between
from s2c2a.lab.tracking.tags.camera import CameraModel
from s2c2a.lab.tracking.tags.detection import TagDropReason
from s2c2a.lab.tracking.tags.estimation import TagPoses, estimate_poses
from s2c2a.lab.tracking.tags.layout import BASE, TagLayout
from s2c2a.lab.tracking.tags.pictures import Effects
from s2c2a.progress import Progress

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
        pictures: number of pictures.
        position_errors: of the tip in the camera frame [m], where it was measured.
        rotation_errors: of the tip [rad].
        base_errors: of the tip's position in the base frame [m], where base and tip
            were measured in one picture.
        wrong: tips that were measured wrong by more than 20 mm or 10 deg.
        seconds: of every picture, for detection and poses [s].
        dropped: tags and bodies by reason.
    """

    distance: float
    pictures: int
    position_errors: np.ndarray
    rotation_errors: np.ndarray
    base_errors: np.ndarray
    wrong: int
    seconds: np.ndarray
    dropped: Counter[TagDropReason]

    @property
    def missing(self) -> float:
        """Share of the pictures without a pose of the tip."""
        return 1 - len(self.position_errors) / self.pictures


def measure_accuracy(
    arm: ArmSpec,
    camera: CameraModel,
    layout: TagLayout,
    distances: Sequence[float],
    pictures: int = 50,
    effects: Effects | None = None,
    portrait: bool = False,
    seed: int = 0,
    progress: Progress | None = None,
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
        S2C2AError: this computer cannot render, or the arm has tension actuation.
    """
    effects = effects or Effects()
    scene = TagScene(camera, layout, min(m.cable_radius for m in arm.modules))
    random = np.random.default_rng([seed, _STREAM])
    try:
        poses = _random_poses(arm, random)
        results: list[TagAccuracy] = []
        for distance in distances:
            study = _Study(scene, camera, layout, effects, portrait, random)
            for number in range(pictures):
                study.take(next(poses), distance, number)
                if progress is not None:
                    done = len(results) * pictures + number + 1
                    progress("pictures", done, len(distances) * pictures)
            results.append(study.result(distance, pictures))
    finally:
        scene.close()
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


class _Study:
    """Collects the errors at one distance."""

    def __init__(
        self,
        scene: TagScene,
        camera: CameraModel,
        layout: TagLayout,
        effects: Effects,
        portrait: bool,
        random: np.random.Generator,
    ):
        self._scene = scene
        self._camera = camera
        self._layout = layout
        self._effects = effects
        self._portrait = portrait
        self._random = random
        self._position_errors: list[float] = []
        self._rotation_errors: list[float] = []
        self._base_errors: list[float] = []
        self._seconds: list[float] = []
        self._dropped: Counter[TagDropReason] = Counter()

    def take(self, poses: dict[str, Pose], distance: float, number: int) -> None:
        """Take one picture and compare."""
        tip = list(poses)[-1]
        view = self._view(poses[tip], distance)
        effects = Effects(self._effects.noise, self._effects.blur, seed=number)
        image = self._scene.render(poses, view, effects)
        start = time.perf_counter()
        found = estimate_poses(image, self._camera, self._layout)
        self._seconds.append(time.perf_counter() - start)
        self._dropped.update(found.dropped)
        self._compare(found, poses, view, tip)

    def _compare(
        self, found: TagPoses, poses: dict[str, Pose], view: Pose, tip: str
    ) -> None:
        if tip not in found.poses:
            return
        measured = found.poses[tip]
        true = view.inverse() @ poses[tip]
        self._position_errors.append(_distance(measured, true))
        self._rotation_errors.append(angle_between(measured, true))
        if BASE in found.poses:
            in_base = found.poses[BASE].inverse() @ measured
            self._base_errors.append(_distance(in_base, poses[tip]))

    def _view(self, tip: Pose, distance: float) -> Pose:
        """`T_world_camera`."""
        azimuth = self._random.uniform(0, 2 * np.pi)
        elevation = self._random.uniform(*_ELEVATIONS)
        flat = np.cos(elevation)
        direction = np.array(
            [flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)]
        )
        position = tip.position + distance * direction
        side = self._camera.width if self._portrait else self._camera.height
        seen = distance * side / self._camera.focal_lengths[0]
        fits = np.linalg.norm(tip.position) < _FITS * seen
        target = tip.position / 2 if fits else tip.position
        up = (0.0, 0.0, 1.0)
        if self._portrait:
            right = np.cross(target - position, up)
            up = (float(right[0]), float(right[1]), float(right[2]))
        return look_at(position, target, up)

    def result(self, distance: float, pictures: int) -> TagAccuracy:
        """Return the errors."""
        positions = np.array(self._position_errors)
        rotations = np.array(self._rotation_errors)
        is_wrong = (positions > WRONG_POSITION) | (rotations > WRONG_ROTATION)
        return TagAccuracy(
            distance,
            pictures,
            positions,
            rotations,
            np.array(self._base_errors),
            int(is_wrong.sum()),
            np.array(self._seconds),
            self._dropped,
        )


def _distance(first: Pose, second: Pose) -> float:
    return float(np.linalg.norm(first.position - second.position))
