"""How cameras and motors stand to an arm: by it columns of a log become what cables did and where ends were.

An import finds it and leaves it in its recording, so that another session of the same
arm can be read alike.
"""

from typing import Annotated, NamedTuple

import numpy as np
from jaxtyping import Float
from pydantic import Field, ValidationError, model_validator

from s2c2a.arm import ArmSpec
from s2c2a.data import Recording
from s2c2a.logs.errors import LogError
from s2c2a.logs.map import MAX_CABLES, Column, Frozen, LogMap, Three
from s2c2a.logs.session import factor_of
from s2c2a.logs.tables import listed

KEY = "rig"
# share of the rows that are compared with another recording: those whose cables stood
# nearest to its own
NEAREST = 0.1
Drive = Annotated[int, Field(ge=0, lt=MAX_CABLES)]


class Rig(Frozen):
    """See the module.

    Attributes:
        names: of the drives: their columns.
        scales: what turned these columns into meters or newtons.
        drive: number of the drive on each cable, by module and cable.
        factor: displacement [m], positive where the cable gets longer, or tension [N],
            for a unit of the drive.
        base: of the arm, in the log's frame [m].
        axes: x, y and z of the arm's base frame there.
    """

    names: tuple[Column, ...] = Field(max_length=MAX_CABLES)
    scales: tuple[float, ...] = Field(max_length=MAX_CABLES)
    drive: tuple[tuple[Drive, ...], ...] = Field(max_length=MAX_CABLES)
    factor: tuple[tuple[float, ...], ...] = Field(max_length=MAX_CABLES)
    base: Three
    axes: tuple[Three, Three, Three]

    @model_validator(mode="after")
    def _fits_together(self):
        counts = [[len(row) for row in rows] for rows in (self.drive, self.factor)]
        if counts[0] != counts[1] or len(self.scales) != len(self.names):
            raise ValueError("its numbers of cables or drives disagree")
        if max((drive for row in self.drive for drive in row), default=0) >= len(
            self.names
        ):
            raise ValueError(f"it names a drive beyond the {len(self.names)} there are")
        if not np.allclose(
            np.array(self.axes) @ np.array(self.axes).T, np.eye(3), atol=1e-3
        ):
            raise ValueError("its axes are not those of a frame")
        return self

    @classmethod
    def found(
        cls,
        told: LogMap,
        drive: np.ndarray,
        factor: np.ndarray,
        base: np.ndarray,
        axes: np.ndarray,
    ) -> "Rig":
        """What an import found, for the drives of a map."""
        arrays = {"drive": drive, "factor": factor, "base": base, "axes": axes}
        return cls(
            names=tuple(drive.name for drive in told.drives),
            scales=_scales(told),
            **{name: one.tolist() for name, one in arrays.items()},
        )

    @classmethod
    def of(cls, recording: Recording, told: LogMap) -> "Rig":
        """That of a recording, for another log of the same arm.

        Raises:
            LogError: it was made of no log, or the map tells of another arm or other
                drives.
        """
        try:
            rig = cls.model_validate(recording.options.get(KEY))
        except ValidationError as error:
            raise LogError(
                "that recording does not say how cameras and motors stood; import its logs anew, without --like"
            ) from error
        arm = recording.arm
        names = tuple(drive.name for drive in told.drives)
        check_arm(arm, told)
        _check_alike("the drives", listed(names), listed(rig.names))
        for name, now, then in zip(names, _scales(told), rig.scales, strict=True):
            _check_alike(f"what turns '{name}' into meters or newtons", now, then)
        if np.shape(rig.drive) != (arm.module_count, arm.cable_count):
            raise LogError(
                f"that recording's rig is not one of '{arm.name}'; import its logs anew, without --like"
            )
        return rig

    def cables(
        self, columns: Float[np.ndarray, "rows drives"]
    ) -> Float[np.ndarray, "rows modules cables"]:
        """What the arm's cables do, when the drives' columns say this."""
        return columns[:, np.array(self.drive)] * np.array(self.factor)

    def in_base(
        self, states: Float[np.ndarray, "rows modules 6"]
    ) -> Float[np.ndarray, "rows modules 6"]:
        """What was seen in the log's frame, in the arm's base frame."""
        return in_frame(states, np.array(self.base), np.array(self.axes))


def in_frame(
    states: Float[np.ndarray, "*batch 6"],
    base: Float[np.ndarray, "3"],
    axes: Float[np.ndarray, "3 3"],
) -> Float[np.ndarray, "*batch 6"]:
    """Positions and axes in the frame that stands at a base, with these axes as rows."""
    return np.concatenate(
        [(states[..., :3] - base) @ axes.T, states[..., 3:] @ axes.T], axis=-1
    )


def check_arm(arm: ArmSpec, told: LogMap) -> None:
    """Refuse an arm that a map does not tell of.

    Raises:
        LogError: another number of modules, another control rate, or driven by another
            kind of command.
    """
    _check_alike("modules", told.arm.modules, arm.module_count)
    _check_alike("control_rate", float(told.arm.control_rate), float(arm.control_rate))
    _check_alike(
        "actuation",
        "tension" if told.drives[0].unit == "N" else "displacement",
        arm.actuation,
    )


def _check_alike(what: str, told: object, there: object) -> None:
    if told != there:
        raise LogError(
            f"{what}: {told} in the map, {there} in the arm or recording that was given; let both say the same"
        )


class Nearby(NamedTuple):
    """Rows of a session whose cables stood nearest to some of the first one.

    Attributes:
        moved: of the tip from where it was then [m], base frame, shape (rows, 3).
        cables: how far the cables' displacements [m] or tensions [N] were from those
            then, root of the mean square, shape (rows,).
    """

    moved: Float[np.ndarray, "rows 3"]
    cables: Float[np.ndarray, " rows"]


def nearby(
    cables: Float[np.ndarray, "rows modules cables"],
    tips: Float[np.ndarray, "rows 3"],
    first_cables: Float[np.ndarray, "others modules cables"],
    first_tips: Float[np.ndarray, "others 3"],
) -> Nearby:
    """Hold a session against the first one; without a row where neither saw the tip."""
    from scipy.spatial import KDTree

    sides = []
    for moved, seen in ((cables, tips), (first_cables, first_tips)):
        flat = moved.reshape(len(moved), -1)
        whole = np.isfinite(seen).all(axis=-1) & np.isfinite(flat).all(axis=-1)
        sides.append((flat[whole], seen[whole]))
    (now, tip), (then, there) = sides
    if not len(now) or not len(then):
        return Nearby(np.zeros((0, 3)), np.zeros(0))
    distances, places = KDTree(then).query(now)
    near = distances <= np.quantile(distances, NEAREST)
    return Nearby((tip - there[places])[near], distances[near] / np.sqrt(now.shape[1]))


def _scales(told: LogMap) -> tuple[float, ...]:
    return tuple(float(factor_of(drive, told)) for drive in told.drives)
