r"""Cause of the difference between two takes: camera, homing, payload, larger pulls.

In rows with similar cables, the displacement of an end at p is fitted as

$$ t + w \times p + c_k (p_x, p_y, 0) + e_k (0, 0, p_x^2 + p_y^2) / L. $$

A moved camera shifts (t) and rotates (w) all ends, also near rest; a large motion is
registered first, and t and w are what is left of it. A payload leaves the
straight arm where it is, bends it further or less (c, of each end k), and moves bent
ends along gravity (e).

Motors that were homed anew, or cables that slipped, are constant offsets \(o\) of the
cables: they displace the ends by \(J(u)\,o\) instead of \(t + w \times p\), with the
derivative of a smooth map of the first take from cables u to ends. The model that leaves
less of the displacements names the cause; if both leave as much, the data cannot tell.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from s2c2a.arm import ArmSpec
from s2c2a.logs.frame_motion import quadratic_terms
from s2c2a.models.session_fit import register

Positions = Float[np.ndarray, "rows modules 3"]
COMPARED_SHARE = 0.5  # of the rows: those with the most similar cables
MIN_ROWS = 20
MOVED_SHARE = 0.01  # of the arm's length, by which a camera has moved
MOVED_ANGLE = np.deg2rad(1.7)
CLEARLY = 0.9
"""Ratio of the displacements that two models leave, below which one is the cause. In the
takes of `tests/logs/test_take_change.py`, the true cause has 0.33 to 0.86; where
both explain the difference, the ratio is 0.97 to 1."""
SAG = 0.1  # least coefficient e of a payload, at the outermost end
EXTRAPOLATED = 3.0  # usual distances of neighboring cables in the first take
_ITERATIONS = 15
_RIGID = 6
_RCOND = 1e-6
_LEAST = 1e-9  # m


class TakeChange(NamedTuple):
    """Difference of a take from the first one, in the base frame.

    Attributes:
        shift: of all ends [m], shape (3,).
        rotation: rotation vector of all ends [rad], shape (3,).
        sag: coefficient e of the outermost end, positive along gravity; zero if gravity
            is across the straight arm.
        extrapolated: share of the steps with cables unlike any of the first take.
        length: of the arm [m].
        offset_motion: largest motion of an end by the constant offsets of the cables
            that explain the difference instead, root mean square [m].
        rigid_error: mean displacement that shift and rotation leave [m].
        offset_error: the same of the offsets.
        tips: displacements of the tip in rows with similar cables [m]; NaN: unknown.
    """

    shift: Float[np.ndarray, "3"]
    rotation: Float[np.ndarray, "3"]
    sag: float
    extrapolated: float
    length: float
    offset_motion: float
    rigid_error: float
    offset_error: float
    tips: Float[np.ndarray, "rows 3"]

    @property
    def may_be_homing(self) -> bool:
        """Whether offsets of the cables may explain the difference."""
        is_worse = self.rigid_error < CLEARLY * self.offset_error
        return self._has_changed and not is_worse

    @property
    def is_moved(self) -> bool:
        """Whether a camera may have moved."""
        is_worse = self.offset_error < CLEARLY * self.rigid_error
        return self._is_rigid and not is_worse

    @property
    def _has_changed(self) -> bool:
        return self._is_rigid or self.offset_motion > MOVED_SHARE * self.length

    @property
    def _is_rigid(self) -> bool:
        return bool(
            np.linalg.norm(self.shift) > MOVED_SHARE * self.length
            or np.linalg.norm(self.rotation) > MOVED_ANGLE
        )

    @property
    def is_payload(self) -> bool:
        """Whether a payload explains the difference."""
        return not (self.is_moved or self.may_be_homing) and self.sag > SAG


def find_change(
    cables: Float[np.ndarray, "rows modules cables"],
    positions: Positions,
    first_cables: Float[np.ndarray, "others modules cables"],
    first_positions: Float[np.ndarray, "others modules 3"],
    arm: ArmSpec,
) -> TakeChange | None:
    """Compare a take with the first one, in rows with similar cables.

    None if too few rows can be compared.

    Args:
        cables: displacements [m] or tensions [N].
        positions: of the ends [m], base frame; NaN: not measured.
        first_cables: the same of the first take.
        first_positions: the same of the first take.
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
    derivatives = _derivatives(first_flat, first_positions)
    # similar cables are not equal: the smooth map explains the rest
    changes = flat[similar] - first_flat[nearest[similar]]
    middles = flat[similar] - changes / 2
    places = places + np.einsum("nmxd,nd->nmx", derivatives(middles), changes)
    displacements = positions[similar] - places
    # fewer rows of the first take than terms of its map determine no derivatives
    seen = np.isfinite(first_positions).all(axis=-1).sum(axis=0)
    terms = quadratic_terms(first_flat[:1]).shape[1]
    displacements[:, seen < terms] = np.nan
    is_known = np.isfinite(displacements).all(axis=-1)
    if is_known.any(axis=1).sum() < MIN_ROWS:
        return None
    return _explain(
        places, derivatives(flat[similar]), displacements, extrapolated, arm
    )


def _explain(
    places: Positions,
    derivatives: Float[np.ndarray, "rows modules 3 drives"],
    displacements: Positions,
    extrapolated: float,
    arm: ArmSpec,
) -> TakeChange:
    """Fit a moved camera, and offsets of the cables, each beside a payload."""
    known = np.isfinite(displacements).all(axis=-1)
    drives = derivatives.shape[-1]
    features = _features(np.nan_to_num(places), arm.length)
    shift, rotation = register(places[known], (places + displacements)[known])
    turn = Rotation.from_rotvec(rotation)
    registered = turn.apply(places[known]) + shift
    weights, rigid_error = _fit(
        features[known], turn.inv().apply((places + displacements)[known] - registered)
    )
    with_offsets = np.concatenate([derivatives, features[..., _RIGID:]], axis=-1)
    offsets, offset_error = _fit(with_offsets[known], displacements[known])
    motions = np.linalg.norm(derivatives @ offsets[:drives], axis=-1)
    seen = np.where(known, motions, 0.0)
    motion = np.sqrt((seen**2).mean(axis=0)).max()
    return TakeChange(
        shift + turn.apply(weights[:3]),
        (turn * Rotation.from_rotvec(weights[3:_RIGID])).as_rotvec(),
        float(np.sign(arm.gravity_direction[2]) * weights[-1]),
        extrapolated,
        arm.length,
        float(motion),
        rigid_error,
        offset_error,
        displacements[:, -1],
    )


def _fit(
    features: Float[np.ndarray, "ends 3 features"], values: Float[np.ndarray, "ends 3"]
) -> tuple[Float[np.ndarray, " features"], float]:
    """Robust least squares: weights, and mean displacement that they leave [m]."""
    rows = np.ones(len(values))
    for _ in range(_ITERATIONS):
        moments = np.einsum("n,nij,nik->jk", rows, features, features)
        products = np.einsum("n,nij,ni->j", rows, features, values)
        # units differ: meters, radians, and those of the cables
        scales = np.sqrt(np.diag(moments)) + _LEAST
        scaled = moments / scales / scales[:, None]
        weights = np.linalg.lstsq(scaled, products / scales, rcond=_RCOND)[0] / scales
        errors = np.linalg.norm(values - features @ weights, axis=1)
        rows = 1 / np.maximum(1, errors / (np.median(errors) + _LEAST))
    return weights, float(errors.mean())


def _derivatives(
    cables: Float[np.ndarray, "rows drives"],
    positions: Positions,
) -> Callable[
    [Float[np.ndarray, "others drives"]], Float[np.ndarray, "others modules 3 drives"]
]:
    """Derivative of the ends by the cables, from a quadratic regression of a take."""
    middle = cables.mean(axis=0)
    scale = cables.std(axis=0) + _LEAST
    scaled = (cables - middle) / scale
    known = np.isfinite(positions).all(axis=-1)
    columns = []
    for module in range(positions.shape[1]):
        rows = known[:, module]
        values = positions[rows, module]
        columns.append(
            np.linalg.lstsq(quadratic_terms(scaled[rows]), values, rcond=_RCOND)[0]
        )
    weights = np.stack(columns, axis=1)  # (terms, modules, 3)
    units = np.eye(cables.shape[1])

    def derivative(values: np.ndarray) -> np.ndarray:
        near = (values - middle) / scale
        # the central difference of a quadratic function is exact
        slopes = [
            (quadratic_terms(near + unit) - quadratic_terms(near - unit)) / 2
            for unit in units
        ]
        changes = [np.einsum("nt,tmx->nmx", slope, weights) for slope in slopes]
        return np.stack(changes, axis=-1) / scale

    return derivative


def _features(
    places: Positions, length: float
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


def describe_change(change: TakeChange) -> str:
    """Describe what explains the difference, and what to do, in sentences."""
    angle = np.rad2deg(np.linalg.norm(change.rotation))
    shift = 1e3 * np.linalg.norm(change.shift)
    rigid = f"all ends are shifted by {shift:.1f} mm and rotated by {angle:.1f} deg"
    if change.is_moved or change.may_be_homing:
        text = f"{_describe_cause(change, rigid)}. Import this take without --like"
    elif change.is_payload:
        text = (
            "consistent with a payload: bent ends sag along gravity, and near rest "
            f"they are where they were ({rigid})"
        )
    else:
        text = f"no camera has moved ({rigid})"
    if change.extrapolated:
        text += (
            f". In {100 * change.extrapolated:.0f} % of the steps, cables are unlike any "
            "of the first recording: a model of it extrapolates there"
        )
    return text


def _describe_cause(change: TakeChange, rigid: str) -> str:
    moved = 1e3 * change.offset_motion
    camera = f"a camera or the base has moved ({rigid}, also near rest)"
    homing = (
        "motors were homed anew, or cables slipped (constant offsets of the cables move "
        f"an end by {moved:.1f} mm)"
    )
    if change.is_moved and change.may_be_homing:
        return f"{camera}, or {homing}: the data cannot tell"
    return camera if change.is_moved else homing
