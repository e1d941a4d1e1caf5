"""Bodies as emulated motion capture sees them, with noise and faults."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from s2c2a.lab.emulation.fault_texts import Fault
from s2c2a.lab.emulation.plant import FramePose

_MILLIMETERS = 1000.0  # of a meter
_FAR = 1e9  # m


@dataclass(frozen=True)
class StreamedBody:
    """A rigid body in a frame.

    Attributes:
        pose: in the axes of the stream.
        is_tracked: whether the cameras see it; otherwise the pose is the last known
            one.
    """

    pose: FramePose
    is_tracked: bool = True


Bodies = Mapping[str, StreamedBody]
"""Rigid bodies of a frame by name."""


def to_stream(pose: FramePose, up: str) -> FramePose:
    """Return a pose of a world with z up in the axes of the stream.

    With y up, (x, y, z) becomes (x, z, -y), also in the vector of the quaternion.
    """
    if up == "z":
        return pose
    x, y, z, w = pose.rotation
    rotation = np.array([x, z, -y, w])
    (x, y, z) = pose.position
    return FramePose(np.array([x, z, -y]), rotation)


def flip(pose: FramePose) -> FramePose:
    """Return a pose that is turned by 180 deg about the x axis of its body."""
    x, y, z, w = pose.rotation
    # the product of quaternions (x, y, z, w) and (1, 0, 0, 0)
    return FramePose(pose.position, np.array([w, z, -y, -x]))


class TrackedBodies:
    """What the cameras see of all bodies."""

    def __init__(
        self, names: Sequence[str], noise: float, up: str, random: np.random.Generator
    ):
        """See all bodies as they are.

        Args:
            names: of the rigid bodies.
            noise: standard deviation of positions [m].
            up: vertical axis of the stream, "y" or "z".
            random: source of the noise.
        """
        self._names = list(names)
        self._noise = noise
        self._up = up
        self._random = random
        self._hidden: dict[str, float] = {}
        self._frozen: dict[str, float] = {}
        self._swapped: set[frozenset[str]] = set()
        self._flipped: set[str] = set()
        self._scale = 1.0
        self._shift = np.zeros(3)
        self._seen: dict[str, FramePose] = {}

    def apply(self, fault: Fault, now: float) -> None:
        """Begin or end a fault of the bodies; other kinds have no effect."""
        if fault.kind in ("hidden", "frozen"):
            seconds = fault.values[0] if fault.values else math.inf
            ends = self._hidden if fault.kind == "hidden" else self._frozen
            ends[fault.targets[0]] = now + seconds
        elif fault.kind == "swapped":
            self._swapped ^= {frozenset(fault.targets)}
        elif fault.kind == "flipped":
            self._flipped ^= set(fault.targets)
        elif fault.kind == "millimeters":
            self._scale = _MILLIMETERS if self._scale == 1.0 else 1.0
        elif fault.kind == "knocked":
            self._shift = self._shift + np.array([fault.values[0], 0.0, 0.0])

    def see(
        self, poses: Mapping[str, FramePose], now: float
    ) -> dict[str, StreamedBody]:
        """Return the bodies of a frame.

        Args:
            poses: `T_world_body` by name, z up.
            now: time since the start [s].
        """
        poses = dict(poses)
        for pair in self._swapped:
            (first, second) = pair
            poses[first], poses[second] = poses[second], poses[first]
        return {name: self._see_one(name, poses[name], now) for name in self._names}

    def _see_one(self, name: str, pose: FramePose, now: float) -> StreamedBody:
        """Return a body with noise; a hidden or frozen one where it was seen last."""
        if now < self._hidden.get(name, -math.inf):
            return StreamedBody(self._seen.get(name, pose), is_tracked=False)
        if now < self._frozen.get(name, -math.inf) and name in self._seen:
            return StreamedBody(self._seen[name])
        if name in self._flipped:
            pose = flip(pose)
        noise = self._random.normal(0.0, self._noise, 3)
        noisy = replace(
            pose, position=self._scale * (pose.position + self._shift + noise)
        )
        self._seen[name] = to_stream(noisy, self._up)
        return StreamedBody(self._seen[name])

    def corrupt(self, bodies: Bodies) -> dict[str, StreamedBody]:
        """Return the bodies with impossible numbers in one of them."""
        name = self._names[self._random.integers(len(self._names))]
        pose = bodies[name].pose
        choices = (
            FramePose(np.full(3, _FAR), pose.rotation),
            FramePose(np.full(3, np.inf), pose.rotation),
            FramePose(pose.position, 3 * pose.rotation),
        )
        corrupted = choices[self._random.integers(len(choices))]
        return {**bodies, name: StreamedBody(corrupted)}
