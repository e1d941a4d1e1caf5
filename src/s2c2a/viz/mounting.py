"""How an arm stands in the world: points are drawn in its base frame, by cameras that stand upright."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec

STEEP = 0.7  # part of gravity along the arm from which on it stands or hangs; below it lies
View = tuple[int, int]
"""Which coordinates run to the right and upward."""


@dataclass(frozen=True, eq=False)
class Mounting:
    """Which way an arm's base frame is turned in the world.

    In the world z is up and, where the arm lies, x is where it points to; without gravity the arm stands.

    Attributes:
        turn: rotation from the base frame to the world; its rows are the world's axes in the base frame.
        gravity: direction in which things fall, base frame, or zero.
        word: "stands", "hangs", "lies", or "floats" without gravity.
    """

    turn: Float[np.ndarray, "3 3"]
    gravity: Float[np.ndarray, "3"]
    word: str

    @classmethod
    def of(cls, arm: ArmSpec) -> "Mounting":
        """The mounting that an arm's gravity says."""
        gravity = np.array(arm.gravity_direction, float)
        up = -gravity / np.linalg.norm(gravity) if gravity.any() else np.array([0.0, 0.0, 1.0])
        lies = abs(up[2]) < STEEP
        ahead = np.array([0.0, 0.0, 1.0] if lies else [1.0, 0.0, 0.0])
        ahead = ahead - (ahead @ up) * up
        ahead = ahead / np.linalg.norm(ahead)
        word = "lies" if lies else "stands" if up[2] > 0 else "hangs"
        return cls(np.stack([ahead, np.cross(up, ahead), up]), gravity, word if gravity.any() else "floats")

    @property
    def upright(self) -> bool:
        """Whether the arm rises from what it is mounted on."""
        return self.word in ("stands", "floats")

    def placed(self, point) -> Float[np.ndarray, "3"]:
        """A point round a standing arm of length one, such as a camera's, as it serves this arm; base frame.

        What is above a standing arm's base is as far below a hanging one's; a lying arm's middle is where a standing
        arm's is.
        """
        x, y, z = point
        moved = {"hangs": (x, y, -z), "lies": (x + 0.5, y, z - 0.5)}.get(self.word, (x, y, z))
        return moved @ self.turn

    def flat(self, view: View) -> tuple[View, tuple[bool, bool]]:
        """The base frame's axes nearest to the world's, for drawings of two axes, and which of them run backward."""
        axes = {0 if self.word == "lies" else 2: 2}
        for world in {0, 1, 2} - set(axes):
            axes[world] = max({0, 1, 2} - set(axes.values()), key=lambda axis: abs(self.turn[world, axis]))
        right, up = view
        return (axes[right], axes[up]), (self.turn[right, axes[right]] < 0, self.turn[up, axes[up]] < 0)
