"""Scene files of the obstacles that were placed on the live page."""

import os
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from scipy.spatial.transform import Rotation

from s2c2a.errors import TargetError
from s2c2a.files.text import check_replaceable, write_atomically
from s2c2a.obstacles import (
    CENTER,
    CORE,
    DISC,
    HALF_EDGES,
    HALF_SPACE,
    SKIN,
    THRESHOLD,
    TURN,
    is_half_space,
    normal_of,
)
from s2c2a.tasks.scenes import SOLID, AnySolid, Row, Scene


def save_scene(scene: Scene, path: str | os.PathLike) -> None:
    """Write a scene file; reading it back gives an equal scene.

    Raises:
        TargetError: the file exists, or it cannot be written.
    """
    if Path(path).exists():
        raise TargetError(f"{path} exists; choose another name")
    check_replaceable(path, ".toml", TargetError)
    values = scene.model_dump(mode="json", exclude_none=True)
    write_atomically(tomli_w.dumps(values), path, TargetError)


def solid_of(row: Row) -> AnySolid:
    """The solid of a row at rest, with lengths to a micrometer."""
    threshold = float(row[THRESHOLD])
    core = row[CORE]
    half = core[HALF_EDGES]
    disc = float(core[DISC])
    quaternion = core[TURN] if core[TURN].any() else [0, 0, 0, 1]
    turn = Rotation.from_quat(quaternion)
    axis = turn.apply([0.0, 0.0, half[2]])
    values: dict[str, Any] = {"clearance": max(threshold - SKIN, 0.0)}
    if is_half_space(row):
        normal = normal_of(row)
        values |= {"kind": "half_space", "normal": normal}
        values["point"] = row[CENTER] + HALF_SPACE * normal
    elif half[:2].any():
        angles = turn.as_euler("xyz", degrees=True)
        values |= {"kind": "box", "size": 2.0 * half, "rotation_deg": angles}
    elif half[2] > 0.0:
        values |= {"start": row[CENTER] - axis, "end": row[CENTER] + axis}
        round_ends = {"kind": "capsule", "radius": threshold, "clearance": 0.0}
        values |= {"kind": "cylinder", "radius": disc} if disc else round_ends
    else:
        values = {"kind": "sphere", "radius": threshold}
    if values["kind"] in ("box", "sphere"):
        values["center"] = row[CENTER]
    rounded = {
        name: value if name == "kind" else (np.round(value, 6) + 0.0).tolist()
        for name, value in values.items()  # plus zero: no negative zero
    }
    return SOLID.validate_python(rounded)
