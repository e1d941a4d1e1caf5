"""Chain of circular arcs that weight deflects: a model of a held arm. NumPy only."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from s2c2a.arm import ArmSpec
from s2c2a.arm.geometry import per_module


@dataclass(frozen=True, eq=False)
class ArcChain:
    """Chain of modules that are circular arcs, deflected by the weight beyond them.

    A lateral force F at the end of a module whose bend is held by its cables moves this
    end by F L^3 / (12 EI), as a beam with guided ends.

    Attributes:
        lengths: of the modules [m], shape (modules,).
        compliances: L^3 / (12 EI) [m/N], shape (modules,).
        weights: force of gravity on what is beyond the middle of each module [N], base
            frame, shape (modules, 3).
    """

    lengths: Float[np.ndarray, " modules"]
    compliances: Float[np.ndarray, " modules"]
    weights: Float[np.ndarray, "modules 3"]

    @classmethod
    def of(cls, arm: ArmSpec) -> "ArcChain":
        """Return the chain of an arm without payload."""
        lengths = per_module(arm, "length")
        masses = per_module(arm, "mass")
        from_tip = arm.tip.mass + np.cumsum(masses[::-1])
        beyond = from_tip[::-1] - masses / 2
        compliances = lengths**3 / (12 * per_module(arm, "bending_stiffness"))
        return cls(lengths, compliances, beyond[:, None] * np.array(arm.gravity))

    def ends(
        self, bends: Float[np.ndarray, "*batch modules 2"]
    ) -> tuple[
        Float[np.ndarray, "*batch modules 3"], Float[np.ndarray, "*batch modules 3 3"]
    ]:
        """Return positions [m] and rotations of the module ends, base frame.

        Args:
            bends: of the modules [rad].
        """
        chords = self.lengths[:, None] * _unit_chords(bends)
        turns = matrices_of(turn_axes(bends))
        half_turns = matrices_of(turn_axes(bends / 2))
        position = np.zeros((*bends.shape[:-2], 3))
        rotation = np.broadcast_to(np.eye(3), (*bends.shape[:-2], 3, 3))
        positions = []
        rotations = []
        for module in range(len(self.lengths)):
            middle = rotation @ half_turns[..., module, :, :]
            step = (rotation @ chords[..., module, :, None])[..., 0]
            position = position + step + self._deflection(module, middle)
            rotation = rotation @ turns[..., module, :, :]
            positions.append(position)
            rotations.append(rotation)
        return np.stack(positions, axis=-2), np.stack(rotations, axis=-3)

    def _deflection(self, module: int, middle: np.ndarray) -> np.ndarray:
        """Deflection by weight across the middle of a module [m], base frame."""
        weight = self.weights[module]
        axis = middle[..., :, 2]
        along = (axis @ weight)[..., None] * axis
        return self.compliances[module] * (weight - along)


def _unit_chords(bends: np.ndarray) -> np.ndarray:
    """Ends of arcs of length one: (b (1 - cos f) / f^2, sin f / f) with f = |b|."""
    angles = np.linalg.norm(bends, axis=-1)
    half_sinc = np.sinc(angles / (2 * np.pi))
    lateral = bends * (half_sinc**2 / 2)[..., None]
    axial = np.sinc(angles / np.pi)[..., None]
    return np.concatenate([lateral, axial], axis=-1)


def matrices_of(vectors: np.ndarray) -> np.ndarray:
    """Rotation matrices, shape (..., 3, 3), of rotation vectors, shape (..., 3)."""
    flat = Rotation.from_rotvec(vectors.reshape(-1, 3)).as_matrix()
    return flat.reshape(*vectors.shape[:-1], 3, 3)


def turn_axes(bends: np.ndarray) -> np.ndarray:
    """Rotation vectors z x b of bends b."""
    x = bends[..., 0]
    y = bends[..., 1]
    return np.stack([-y, x, 0 * x], axis=-1)
