"""Which tags are mounted where: poses of the tags on the bodies of an arm."""

import math
import os
from collections.abc import Iterable

import numpy as np
from jaxtyping import Float
from pydantic import Field, field_validator

from s2c2a.errors import counted, did_you_mean
from s2c2a.files.json_files import load_json, save_json
from s2c2a.lab.tracking.poses import Pose, StoredRotation, StoredTable, TrackingError

FORMAT = 1
FAMILY = "36h11"
MAX_ID = 586  # of the family 36h11
CELLS = 8  # along the side of a tag, with its black border
SHEET = (CELLS + 2) / CELLS  # side of tag and white margin, over that of the tag
TAG_SIZE = 0.04  # m
HALF_WIDTH = 0.032  # m; of a collar
IDS_PER_BODY = 10
FACES = 4
CAP = 4  # number of the tag on top of a collar
MAX_MODULES = 9
BASE = "base"


class LayoutError(TrackingError):
    """A layout of tags is damaged or impossible."""


class Tag(StoredTable):
    """A tag on a body.

    The tag frame has its origin in the center of the tag, x to the right, y up and z
    out of the paper, as the tag is printed.

    Attributes:
        id: number in the family.
        body: name of the body that carries the tag.
        size: side of the black square [m].
        position: of the tag in the frame of the body [m].
        rotation: `T_body_tag`'s unit quaternion (x, y, z, w).
    """

    id: int = Field(strict=True, ge=0, le=MAX_ID)
    body: str = Field(min_length=1, max_length=64)
    size: float = Field(ge=0.005, le=1)
    position: tuple[float, float, float]
    rotation: StoredRotation

    @field_validator("position")
    @classmethod
    def _check_position(cls, position):
        if max(map(abs, position)) > 2:
            raise ValueError("write meters, at most 2 on an axis")
        return position

    @property
    def pose(self) -> Pose:
        """`T_body_tag`."""
        return Pose.measured(self.position, self.rotation)

    @property
    def corners(self) -> Float[np.ndarray, "4 3"]:
        """Corners [m], body frame: top left, top right, bottom right, bottom left."""
        return square(self.size) @ self.pose.matrix.T + self.pose.position

    @property
    def label(self) -> str:
        """Text that is printed beside the tag."""
        normal = self.pose.z_axis
        axis = int(np.argmax(np.abs(normal)))
        side = f"{'-' if normal[axis] < 0 else '+'}{'xyz'[axis]}"
        return f"{self.body}  {side}  id {self.id}"


class TagLayout(StoredTable):
    """All tags of an arm.

    Attributes:
        family: of the tags.
        tags: in any order; every id occurs once.
    """

    format: int = Field(default=FORMAT, ge=FORMAT, le=FORMAT)
    family: str = Field(default=FAMILY, pattern=f"^{FAMILY}$")
    tags: tuple[Tag, ...] = Field(min_length=1, max_length=MAX_ID + 1)

    @field_validator("tags")
    @classmethod
    def _check_ids(cls, tags: tuple[Tag, ...]) -> tuple[Tag, ...]:
        ids = [tag.id for tag in tags]
        repeated = sorted({id for id in ids if ids.count(id) > 1})
        if repeated:
            raise ValueError(f"ids {repeated} occur twice; write every id once")
        return tags

    @classmethod
    def collars(
        cls,
        modules: int,
        size: float = TAG_SIZE,
        half_width: float = HALF_WIDTH,
        bodies: Iterable[str] = (),
        caps: Iterable[str] = (),
    ) -> "TagLayout":
        """Return square collars of four tags around the base and the module ends.

        Tag k = 0 to 3 of a body looks along its +x, +y, -x, -y axis, upright along z.
        Tag 4 lies on top of the collar and looks along +z. The ids are k at the base
        and 10 i + k at the end of module i. A collar of a module is centered on the
        module's end; that of the base ends at the base.

        Args:
            modules: of the arm.
            size: side of the tags [m].
            half_width: distance of the tags from the center line [m].
            bodies: with collars; all by default.
            caps: bodies with a tag on top; the tip by default.

        Raises:
            LayoutError: the modules are too many, the tags do not fit the collar, or
                there is no such body.
        """
        if not 1 <= modules <= MAX_MODULES:
            raise LayoutError(
                f"{counted(modules, 'module')}; collars have ids for 1 to {MAX_MODULES}"
            )
        if not SHEET * size <= 2 * half_width * (1 + 1e-9):
            raise LayoutError(
                f"tags of {1000 * size:g} mm and their white margins need a collar of "
                f"{1000 * SHEET * size:g} mm, got {2000 * half_width:g} mm; choose "
                "smaller tags or a wider collar"
            )
        names = [BASE, *(f"end-{module}" for module in range(1, modules + 1))]
        chosen = _choose(bodies, names) or names
        capped = _choose(caps, names) or names[-1:]
        tags = []
        for number, name in enumerate(names):
            if name in chosen:
                faces = FACES + 1 if name in capped else FACES
                tags += _collar(number, name, size, half_width, faces)
        return cls(tags=tuple(tags))

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the bodies that carry tags."""
        return tuple(dict.fromkeys(tag.body for tag in self.tags))

    @property
    def by_id(self) -> dict[int, Tag]:
        """Tags by id."""
        return {tag.id: tag for tag in self.tags}


def square(size: float) -> Float[np.ndarray, "4 3"]:
    """Return the corners of a square [m], tag frame, in the order of `Tag.corners`."""
    signs = np.array(
        [
            [-1, 1, 0],
            [1, 1, 0],
            [1, -1, 0],
            [-1, -1, 0],
        ]
    )
    return size / 2 * signs


def _choose(bodies: Iterable[str], names: list[str]) -> list[str]:
    chosen = list(bodies)
    unknown = sorted(set(chosen) - set(names))
    if unknown:
        raise LayoutError(
            f"no bodies {unknown}{did_you_mean(unknown[0], names)}; choose of {names}"
        )
    return chosen


def _collar(
    number: int, body: str, size: float, half_width: float, faces: int
) -> list[Tag]:
    height = -half_width if body == BASE else 0.0
    tags = []
    for face in range(faces):
        position, rotation = _face(face, half_width, height)
        id = IDS_PER_BODY * number + face
        tags.append(
            Tag(id=id, body=body, size=size, position=position, rotation=rotation)
        )
    return tags


def _face(
    face: int, half_width: float, height: float
) -> tuple[tuple[float, float, float], tuple[float, float, float, float]]:
    """Position and quaternion of a tag on the collar."""
    if face == CAP:
        return (0.0, 0.0, height + half_width), (0.0, 0.0, 0.0, 1.0)
    angle = face * math.pi / 2
    x = half_width * math.cos(angle)
    y = half_width * math.sin(angle)
    # the turn about z after the turn that carries x, y, z of the tag to y, z, x
    half = angle / 2
    quaternion = (0, 0, math.sin(half), math.cos(half))
    turn = Pose.measured((0, 0, 0), quaternion)
    first = Pose.measured((0, 0, 0), (0.5, 0.5, 0.5, 0.5))
    qx, qy, qz, qw = (float(value) for value in (turn @ first).rotation)
    return (x, y, height), (qx, qy, qz, qw)


def save_layout(layout: TagLayout, path: str | os.PathLike) -> None:
    """Write a layout file; an interruption leaves the former file.

    Raises:
        LayoutError: the file cannot be written.
    """
    save_json(layout, path, LayoutError)


def load_layout(path: str | os.PathLike) -> TagLayout:
    """Read a layout file.

    Raises:
        LayoutError: there is no such file, or it is damaged.
    """
    advice = "make one with `s2c2a tracking print-tags`"
    return load_json(TagLayout, path, LayoutError, "layout of tags", advice)
