r"""Cause of the difference between two sessions: moved camera, payload, larger pulls.

In rows with similar cables, the displacement of an end at p is fitted as

$$ t + w \times p + c_k (p_x, p_y, 0) + e_k (0, 0, p_x^2 + p_y^2) / L. $$

A moved camera shifts (t) and rotates (w) all ends, also near rest. A payload leaves the
straight arm where it is, bends it further or less (c, of each end k), and moves bent
ends along gravity (e).
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.spatial import KDTree

from s2c2a.arm import ArmSpec

COMPARED_SHARE = 0.5  # of the rows: those with the most similar cables
MIN_ROWS = 20
MOVED_SHARE = 0.01  # of the arm's length, by which a camera has moved
MOVED_ANGLE = np.deg2rad(1.7)
SAG = 0.1  # least coefficient e of a payload, at the outermost end
EXTRAPOLATED = 3.0  # usual distances of neighboring cables in the first session
_ITERATIONS = 15
_RIGID = 6
_LEAST = 1e-9  # m


class SessionChange(NamedTuple):
    """Difference of a session from the first one, in the base frame.

    Attributes:
        shift: of all ends [m], shape (3,).
        rotation: vector of a small rotation of all ends [rad], shape (3,).
        sag: coefficient e of the outermost end, positive along gravity; zero if gravity
            is across the straight arm.
        extrapolated: share of the steps with cables unlike any of the first session.
        rows: number of compared rows; with too few, the others are zero.
        length: of the arm [m].
    """

    shift: Float[np.ndarray, "3"]
    rotation: Float[np.ndarray, "3"]
    sag: float
    extrapolated: float
    rows: int
    length: float

    @property
    def is_moved(self) -> bool:
        """Whether a camera has moved."""
        return bool(
            np.linalg.norm(self.shift) > MOVED_SHARE * self.length
            or np.linalg.norm(self.rotation) > MOVED_ANGLE
        )

    @property
    def is_known(self) -> bool:
        """Whether enough rows could be compared."""
        return self.rows >= MIN_ROWS

    @property
    def is_payload(self) -> bool:
        """Whether a payload explains the difference."""
        return not self.is_moved and self.sag > SAG


def find_change(
    cables: Float[np.ndarray, "rows modules cables"],
    positions: Float[np.ndarray, "rows modules 3"],
    first_cables: Float[np.ndarray, "others modules cables"],
    first_positions: Float[np.ndarray, "others modules 3"],
    arm: ArmSpec,
) -> SessionChange:
    """Compare a session with the first one, in rows with similar cables.

    Args:
        cables: displacements [m] or tensions [N].
        positions: of the ends [m], base frame; NaN: not measured.
        first_cables: the same of the first session.
        first_positions: the same of the first session.
        arm: gives the length, and the direction of gravity.
    """
    flat = cables.reshape(len(cables), -1)
    first_flat = first_cables.reshape(len(first_cables), -1)
    tree = KDTree(first_flat)
    distances, nearest = tree.query(flat)
    own = tree.query(first_flat, k=2)[0][:, 1]
    usual = float(np.quantile(own, 0.99)) + _LEAST
    is_known = distances <= EXTRAPOLATED * usual
    extrapolated = float(1 - is_known.mean())
    similar = is_known & (distances <= np.quantile(distances, COMPARED_SHARE))
    places = first_positions[nearest[similar]]
    displacements = positions[similar] - places
    rows = int(np.isfinite(displacements).all(axis=-1).any(axis=1).sum())
    nothing = np.zeros(3)
    if rows < MIN_ROWS:
        return SessionChange(nothing, nothing, 0.0, extrapolated, rows, arm.length)
    weights = _fit(places, displacements, arm.length)
    sag = float(np.sign(arm.gravity_direction[2]) * weights[-1])
    return SessionChange(
        weights[:3], weights[3:_RIGID], sag, extrapolated, rows, arm.length
    )


def _fit(
    places: Float[np.ndarray, "rows modules 3"],
    displacements: Float[np.ndarray, "rows modules 3"],
    length: float,
) -> np.ndarray:
    """Robust least squares of shift, rotation, and c and e of each end."""
    known = np.isfinite(displacements).all(axis=-1)
    features = _features(np.nan_to_num(places), length)[known]
    values = displacements[known]
    rows = np.ones(len(values))
    for _ in range(_ITERATIONS):
        moments = np.einsum("n,nij,nik->jk", rows, features, features)
        products = np.einsum("n,nij,ni->j", rows, features, values)
        weights = np.linalg.lstsq(moments, products, rcond=1e-9)[0]
        errors = np.linalg.norm(values - features @ weights, axis=1)
        rows = 1 / np.maximum(1, errors / (np.median(errors) + _LEAST))
    return weights


def _features(
    places: Float[np.ndarray, "rows modules 3"], length: float
) -> Float[np.ndarray, "rows modules 3 features"]:
    """Displacement by each unit of shift, rotation, and c and e of each end."""
    modules = places.shape[1]
    features = np.zeros((*places.shape, _RIGID + 2 * modules))
    features[..., :3] = np.eye(3)
    for axis, unit in enumerate(np.eye(3)):
        features[..., 3 + axis] = np.cross(unit, places)
    across = places[..., :2]
    for module in range(modules):
        begin = _RIGID + 2 * module
        features[:, module, :2, begin] = across[:, module]
        squares = np.sum(across[:, module] ** 2, axis=-1)
        features[:, module, 2, begin + 1] = squares / length
    return features


def describe_change(change: SessionChange) -> str:
    """Describe what explains the difference, and what to do."""
    angle = np.rad2deg(np.linalg.norm(change.rotation))
    shift = 1e3 * np.linalg.norm(change.shift)
    rigid = f"all ends are shifted by {shift:.1f} mm and rotated by {angle:.1f} deg"
    if change.is_moved:
        text = (
            f"a camera or the base has moved: {rigid}, also near rest; import this "
            "session without --like"
        )
    elif change.is_payload:
        text = (
            "consistent with a payload: bent ends sag along gravity, and near rest "
            f"they are where they were ({rigid})"
        )
    else:
        text = f"no camera has moved ({rigid})"
    if change.extrapolated:
        text += (
            f"; {100 * change.extrapolated:.0f} % of the steps have cables unlike any "
            "of the first recording: a model of it extrapolates there"
        )
    return text
