"""Positions and rotations of tracked bodies, from the columns of a log."""

from collections.abc import Iterator, Sequence

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial.transform import Rotation

from s2c2a.errors import counted
from s2c2a.files.tables import METERS
from s2c2a.logs.errors import LogError
from s2c2a.logs.log_map import Body
from s2c2a.logs.tables import Table

ROTATION_TOLERANCE = 0.05  # of products of rows; two decimals stay below 0.02


def stacked(table: Table, columns: Sequence[str]) -> np.ndarray:
    """Columns of a table, shape (rows, columns)."""
    return np.stack([table.numbers[column] for column in columns], axis=-1)


def vectors_of(table: Table, columns: Sequence[str]) -> np.ndarray:
    """Vectors, shape (rows, 3); z is zero where the log has a plane alone."""
    values = stacked(table, columns)
    missing = 3 - values.shape[1]
    return np.pad(values, [(0, 0), (0, missing)])


def positions_of(table: Table, body: Body) -> np.ndarray:
    """Positions of a body [m], NaN where they are not measured, shape (rows, 3)."""
    return vectors_of(table, body.position) * (body.scale * METERS[body.unit])


def unturned(
    table: Table, body: Body, *vectors: np.ndarray
) -> Iterator[Float[np.ndarray, "rows ends 3"]]:
    """Vectors in the frame of a body, NaN where its rotation is not measured."""
    if not body.rotation:
        yield from vectors
        return
    known, rotations = rotations_of(table, body)
    matrices = np.full((len(table), 3, 3), np.nan)
    matrices[known] = rotations.as_matrix()
    for each in vectors:
        yield np.einsum("rji,rej->rei", matrices, each)


def rotations_of(
    table: Table, body: Body
) -> tuple[Bool[np.ndarray, " rows"], Rotation]:
    """Rows in which a body's rotation is measured, and the rotations there."""
    values = stacked(table, body.rotation)
    known = np.isfinite(values).all(axis=1)
    if body.euler is None:
        known &= np.abs(values).sum(axis=1) > 0
    if body.matrix is not None:
        _check_rotations(table, body.matrix, values, known)
    return known, as_rotations(values[known], body)


def _check_rotations(
    table: Table, columns: Sequence[str], values: np.ndarray, known: np.ndarray
) -> None:
    """Refuse matrices that are no rotations."""
    matrices = values.reshape(-1, 3, 3)
    products = matrices @ matrices.transpose(0, 2, 1)
    errors = np.abs(products - np.eye(3)).max(axis=(1, 2))
    finite = np.where(known[:, None, None], matrices, 0.0)
    is_wrong = errors > ROTATION_TOLERANCE
    is_wrong |= np.linalg.det(finite) < 0
    wrong = np.flatnonzero(known & is_wrong)
    if len(wrong):
        matrix = matrices[wrong[0]].round(3).tolist()
        raise LogError(
            f"{table.path}: the matrix '{columns[0]}', ... is no rotation in "
            f"{counted(len(wrong), 'row')}, such as {matrix} in row {wrong[0]}; name "
            "its nine columns row by row, of unit vectors of a right-handed frame"
        )


def as_rotations(values: np.ndarray, body: Body) -> Rotation:
    """Rotations of a body, from its quaternions, matrices or Euler angles."""
    if body.quaternion is not None:
        return Rotation.from_quat(values, scalar_first=body.order == "wxyz")
    if body.matrix is not None:
        return Rotation.from_matrix(values.reshape(-1, 3, 3))
    degrees = body.euler_unit == "deg"
    return Rotation.from_euler(body.sequence or "", values, degrees=degrees)
