"""Frame calibration: poses of the arm's frames in the tracked bodies.

Bodies have any pose on the modules. Held configurations determine `T_base_arm` and
`T_end_module` (`ModuleEnds`): every module is nearly a circular arc that begins at the
end of the module before and has the bend direction of its encoders. The true bends are
unknown in every configuration, with the bends of the encoders as a prior.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.optimize import least_squares
from scipy.sparse import csr_array
from scipy.spatial.transform import Rotation

from s2c2a.arm import ArmSpec
from s2c2a.arm.geometry import per_module
from s2c2a.lab.tracking.arcs import ArcChain, matrices_of, turn_axes
from s2c2a.lab.tracking.poses import Pose, TrackingError, angle_between

BEND_STD = np.deg2rad(10.0)  # of true bends about those of the encoders
POSITION_STD = 0.002  # m; an arm is no exact chain of arcs
ROTATION_STD = np.deg2rad(1.0)  # of ends about those of arcs
OFFSET_STD = 0.05  # m; bodies are mounted near the frames
MIN_TURN = np.deg2rad(3.0)  # of a body when a module before it bends
MAX_BASE_TURN = np.deg2rad(1.0)  # of the base during all configurations
MAX_BASE_SHIFT = 0.003  # m
MAX_ALIGNMENT = np.deg2rad(25.0)  # between directions of turns and of encoders
LENGTH_RATIO = 5.0  # of measured and described lengths, where units are wrong
MAX_POSITION_RESIDUAL = 0.010  # m
MAX_ROTATION_RESIDUAL = np.deg2rad(5.0)


class FrameError(TrackingError):
    """The tracked poses do not determine the frames of an arm."""


@dataclass(frozen=True, eq=False)
class HeldPoses:
    """Mean poses of tracked bodies in one held configuration.

    Attributes:
        bends: of the encoders [rad], shape (modules, 2).
        base: `T_world_base`.
        ends: `T_world_end` of every module end, from the base.
    """

    bends: Float[np.ndarray, "modules 2"]
    base: Pose
    ends: tuple[Pose, ...]


@dataclass(frozen=True, eq=False)
class Frames:
    """Frame offsets, and what they leave unexplained.

    Attributes:
        base_offset: `T_base_arm`.
        end_offsets: `T_end_module` of every module end, from the base.
        position_residuals: root mean square of the positions at every end [m], shape
            (modules,).
        rotation_residuals: likewise of the rotations [rad], shape (modules,).
    """

    base_offset: Pose
    end_offsets: tuple[Pose, ...]
    position_residuals: Float[np.ndarray, " modules"]
    rotation_residuals: Float[np.ndarray, " modules"]


def mean_pose(poses: Sequence[Pose]) -> Pose:
    """Return the mean of poses of one body at rest.

    The rotation minimizes the sum of squared chordal distances, so that the signs of
    quaternions have no influence.

    Raises:
        FrameError: there is no pose.
    """
    if not poses:
        raise FrameError("there is no pose to average; wait until the body is tracked")
    rotation = Rotation.from_quat([pose.rotation for pose in poses]).mean()
    position = np.mean([pose.position for pose in poses], axis=0)
    return Pose(position, rotation.as_quat())


def find_frames(arm: ArmSpec, held: Sequence[HeldPoses]) -> Frames:
    """Find the frames of an arm in its tracked bodies by least squares.

    Args:
        arm: lengths and cable angles of its modules.
        held: rest first, then bends of every module in both directions of both axes,
            so that errors of the arcs cancel.

    Raises:
        FrameError: bodies are swapped, mirrored, do not follow, have other units, or
            leave large residuals.
    """
    measured = _Measured.of(arm, held)
    # check that the base body stands still: it is no end
    first = held[0].base
    moves = [one.base.position - first.position for one in held]
    shift = max(np.linalg.norm(move) for move in moves)
    turn = max(angle_between(one.base, first) for one in held)
    if shift > MAX_BASE_SHIFT or turn > MAX_BASE_TURN:
        raise FrameError(
            f"the base body moves by {1000 * shift:.1f} mm and "
            f"{np.rad2deg(turn):.1f} deg while the arm bends; fix it, or check that "
            "its name is not that of a module end"
        )
    # check the units, from distances of ends, or of one end and the base
    points = measured.positions[0]
    total = measured.lengths[1:].sum()
    distance = np.linalg.norm(points[-1] - points[0])
    if len(points) == 1:
        total = measured.lengths[0]
        distance = np.linalg.norm(points[0])
    if not total / LENGTH_RATIO < distance < total * LENGTH_RATIO:
        raise FrameError(
            f"the ends are {distance:.4g} m apart, and the arm file has {total:.4g} "
            "m; send meters, or state the units of the datagrams"
        )
    _check_order(measured)
    arm_in_base = _align(measured)
    _check_direction(measured, arm_in_base)
    problem = _Problem(ArcChain.of(arm), measured, arm_in_base)
    solution = least_squares(
        problem.residuals,
        np.zeros(problem.size),
        x_scale="jac",
        jac_sparsity=problem.dependencies(),
    )
    frames = problem.frames(solution.x)
    position = frames.position_residuals.max()
    rotation = frames.rotation_residuals.max()
    if position > MAX_POSITION_RESIDUAL or rotation > MAX_ROTATION_RESIDUAL:
        module = int(frames.position_residuals.argmax()) + 1
        raise FrameError(
            f"the frames leave {1000 * position:.1f} mm and {np.rad2deg(rotation):.1f} "
            f"deg unexplained (end-{module} most); at most "
            f"{1000 * MAX_POSITION_RESIDUAL:g} mm and "
            f"{np.rad2deg(MAX_ROTATION_RESIDUAL):g} deg are accepted. Check the lengths "
            "of the arm file, and that no marker slips or is hidden"
        )
    return frames


@dataclass(frozen=True, eq=False)
class _Measured:
    """Poses of the ends in the base body, over configurations.

    Attributes:
        lengths: of the modules [m], shape (modules,).
        bends: of the encoders [rad], shape (configurations, modules, 2).
        positions: of the end bodies [m], shape (configurations, modules, 3).
        rotations: of the end bodies, shape (configurations, modules, 3, 3).
    """

    lengths: np.ndarray
    bends: np.ndarray
    positions: np.ndarray
    rotations: np.ndarray

    @classmethod
    def of(cls, arm: ArmSpec, held: Sequence[HeldPoses]) -> "_Measured":
        bends = np.array([one.bends for one in held])
        expected = (arm.module_count, 2)
        if len(held) < 5 or bends.shape[1:] != expected:
            raise FrameError(
                f"{len(held)} configurations with bends of shape {bends.shape[1:]}; "
                f"give rest and four bends of every module, of shape {expected}"
            )
        poses = [[one.base.inverse() @ end for end in one.ends] for one in held]
        return cls(
            per_module(arm, "length"),
            bends,
            np.array([[pose.position for pose in row] for row in poses]),
            np.array([[pose.matrix for pose in row] for row in poses]),
        )

    @property
    def turns(self) -> np.ndarray:
        """Rotation vectors of the ends from rest, base body, (K, modules, 3)."""
        turned = self.rotations @ self.rotations[0].swapaxes(-1, -2)
        return _vectors(turned)


def _vectors(matrices: np.ndarray) -> np.ndarray:
    flat = Rotation.from_matrix(matrices.reshape(-1, 3, 3)).as_rotvec()
    return flat.reshape(*matrices.shape[:-2], 3)


def _check_order(measured: _Measured) -> None:
    """Check which bodies turn when a module bends: its end, and all beyond it."""
    modules = len(measured.lengths)
    changes = np.linalg.norm(measured.bends - measured.bends[0], axis=-1)
    turns = np.linalg.norm(measured.turns, axis=-1)
    alone = changes.argmax(axis=1)
    bent = changes.max(axis=1) > MIN_TURN
    reach = np.array(
        [turns[bent & (alone == module)].mean(0) for module in range(modules)]
    )
    follows = reach > 0.4 * changes[bent].max(axis=1).mean()
    expected = np.triu(np.ones((modules, modules), bool))
    if (follows == expected).all():
        return
    counts = follows.sum(axis=0)
    texts = [f"end-{body} by {count}" for body, count in enumerate(counts, start=1)]
    order = ", ".join(texts)
    raise FrameError(
        f"bodies turn with other modules than they should ({order} of {modules} "
        "modules; end-1 must turn with one, end-2 with two, ...): bodies are swapped, "
        "or the arm does not follow. Correct the names in the tracker"
    )


def _align(measured: _Measured) -> Float[np.ndarray, "3 3"]:
    """Rotation of the arm's base frame in the base body.

    The ends turn about axes that are perpendicular to the bends of the encoders; the
    rotation between both sets of axes is found as in Kabsch's method.
    """
    # bends of all modules up to each end, less those of rest
    bend_sums = np.cumsum(measured.bends - measured.bends[0], axis=1)
    expected = turn_axes(bend_sums).reshape(-1, 3)
    turns = measured.turns.reshape(-1, 3)
    rotation = Rotation.align_vectors(turns, expected)[0].as_matrix()
    strong = np.linalg.norm(expected, axis=1) > MIN_TURN
    predicted = expected[strong] @ rotation.T
    seen = turns[strong]
    cosines = (predicted * seen).sum(axis=1)
    cosines /= np.linalg.norm(predicted, axis=1) * np.linalg.norm(seen, axis=1)
    error = np.arccos(np.clip(cosines, -1, 1)).mean()
    if error > MAX_ALIGNMENT:
        raise FrameError(
            f"the ends turn about other axes than the encoders measure "
            f"(by {np.rad2deg(error):.0f} deg in the mean); check the order of the cables "
            "(servos.ids, cable_angles_deg), and that the tracker's axes are "
            "right-handed"
        )
    return rotation


def _check_direction(measured: _Measured, arm_in_base: np.ndarray) -> None:
    """Check that the arm extends along the z axis that its bends define."""
    points = measured.positions[0]
    along = points[-1] - (points[0] if len(points) > 1 else 0.0)
    cosine = arm_in_base[:, 2] @ along / np.linalg.norm(along)
    if cosine < 0.5:
        raise FrameError(
            f"the arm extends at {np.rad2deg(np.arccos(cosine)):.0f} deg to the axis "
            "that its bends define; the signs of the cables or the handedness of the "
            "tracker's axes are wrong, or bodies are swapped"
        )


class _Problem:
    """Least squares over offsets and true bends; zero is the first guess.

    Parameters: position and rotation vector of the base offset, those of the end
    offsets, and the differences of true bends and encoders.
    """

    def __init__(self, chain: ArcChain, measured: _Measured, arm_in_base: np.ndarray):
        self._chain = chain
        self._measured = measured
        ends = np.cumsum(measured.lengths)[:, None] * arm_in_base[:, 2]
        self._arm_position = (measured.positions[0] - ends).mean(axis=0)
        self._arm_rotation = arm_in_base
        self._end_rotations = measured.rotations[0].swapaxes(-1, -2) @ arm_in_base
        self._modules = len(measured.lengths)
        self._offset_size = 6 * (1 + self._modules)
        self.size = self._offset_size + measured.bends.size

    def residuals(self, values: np.ndarray) -> np.ndarray:
        """Errors over their standard deviations."""
        position_errors, rotation_errors = self._errors(values)
        offsets = values[: self._offset_size].reshape(-1, 6)
        deviations = values[self._offset_size :]
        return np.concatenate(
            [
                position_errors.ravel() / POSITION_STD,
                rotation_errors.ravel() / ROTATION_STD,
                deviations / BEND_STD,
                offsets[1:, :3].ravel() / OFFSET_STD,
            ]
        )

    def dependencies(self) -> csr_array:
        """Which residuals depend on which parameters, shape (residuals, parameters).

        True bends of a configuration act on its own errors only, so that few steps of
        a finite difference give all derivatives.
        """
        configurations = len(self._measured.bends)
        bends = self.size - self._offset_size
        own = np.kron(
            np.eye(configurations),
            np.ones((3 * self._modules, 2 * self._modules)),
        )
        errors = np.hstack([np.ones((len(own), self._offset_size)), own])
        priors = np.eye(bends, self.size, self._offset_size)
        offsets = np.eye(self._offset_size, self.size).reshape(-1, 6, self.size)
        moved = offsets[1:, :3].reshape(-1, self.size)
        rows = [errors, errors, priors, moved]
        return csr_array(np.vstack(rows))

    def frames(self, values: np.ndarray) -> Frames:
        """Frames at parameters."""
        position_errors, rotation_errors = self._errors(values)
        arm_position, arm_rotation = self._base(values)
        positions, rotations = self._ends(values)
        ends = zip(positions, rotations, strict=True)
        return Frames(
            _pose(arm_position, arm_rotation),
            tuple(_pose(position, rotation) for position, rotation in ends),
            _root_mean_square(position_errors),
            _root_mean_square(rotation_errors),
        )

    def _errors(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Errors of positions [m] and rotations [rad], shape (K, modules, 3)."""
        measured = self._measured
        arm_position, arm_rotation = self._base(values)
        offsets, turns = self._ends(values)
        positions = (
            measured.positions + (measured.rotations @ offsets[..., None])[..., 0]
        )
        rotations = measured.rotations @ turns
        expected, directions = self._chain.ends(self._bends(values))
        expected = arm_position + expected @ arm_rotation.T
        directions = arm_rotation @ directions
        turned = directions.swapaxes(-1, -2) @ rotations
        return positions - expected, _vectors(turned)

    def _base(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        rotation = self._arm_rotation @ matrices_of(values[3:6])
        return self._arm_position + values[:3], rotation

    def _ends(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        offsets = values[6 : self._offset_size].reshape(-1, 6)
        return offsets[:, :3], self._end_rotations @ matrices_of(offsets[:, 3:])

    def _bends(self, values: np.ndarray) -> np.ndarray:
        bends = self._measured.bends
        return bends + values[self._offset_size :].reshape(bends.shape)


def _pose(position: np.ndarray, rotation: np.ndarray) -> Pose:
    return Pose(position, Rotation.from_matrix(rotation).as_quat())


def _root_mean_square(errors: np.ndarray) -> np.ndarray:
    """Over configurations, of the lengths of vectors, shape (modules,)."""
    return np.sqrt((errors**2).sum(axis=-1).mean(axis=0))
