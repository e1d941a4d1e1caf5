"""How cameras and motors stand to an arm: by it columns of a log become what cables did and where ends were.

An import finds it and leaves it in its recording, so that another session of the same arm can be read alike.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from s2c2a.logs.errors import LogError

KEY = "rig"
NEAREST = 0.1  # share of the rows that are compared with another recording: those whose cables stood nearest to its own


@dataclass(frozen=True)
class Rig:
    """See the module.

    Attributes:
        names: of the drives: their columns.
        drive: number of the drive on each cable, shape (modules, cables).
        factor: displacement [m], positive where the cable gets longer, or tension [N], for a unit of the column.
        base: of the arm, in the log's frame [m].
        axes: x, y and z of the arm's base frame there, shape (3, 3).
    """

    names: tuple[str, ...]
    drive: np.ndarray
    factor: np.ndarray
    base: np.ndarray
    axes: np.ndarray

    @classmethod
    def kept_in(cls, options: Mapping[str, Any]) -> "Rig":
        """That of a recording.

        Raises:
            LogError: it was not made of a log.
        """
        kept = options.get(KEY)
        if not isinstance(kept, Mapping) or set(kept) != set(cls.__dataclass_fields__):
            raise LogError("that recording does not say how cameras and motors stood: import its logs anew")
        arrays = {name: np.array(kept[name], int if name == "drive" else float) for name in kept if name != "names"}
        return cls(tuple(map(str, kept["names"])), **arrays)

    def kept(self) -> dict[str, Any]:
        """What a recording keeps of it."""
        rounded = {name: np.round(getattr(self, name), 9).tolist() for name in ("factor", "base", "axes")}
        return {KEY: {"names": list(self.names), "drive": self.drive.tolist(), **rounded}}

    def cables(self, columns: Float[np.ndarray, "rows drives"]) -> Float[np.ndarray, "rows modules cables"]:
        """What the arm's cables do, when the drives' columns say this."""
        return columns[:, self.drive] * self.factor

    def in_base(self, states: Float[np.ndarray, "rows modules 6"]) -> Float[np.ndarray, "rows modules 6"]:
        """What was seen in the log's frame, in the arm's base frame."""
        turned = self.axes.T
        return np.concatenate([(states[..., :3] - self.base) @ turned, states[..., 3:] @ turned], axis=-1)


def apart(
    cables: Float[np.ndarray, "rows modules cables"],
    tips: Float[np.ndarray, "rows 3"],
    others: Float[np.ndarray, "others modules cables"],
    seen: Float[np.ndarray, "others 3"],
) -> Float[np.ndarray, "near 3"]:
    """Of rows whose cables stood nearest to others: how far the tip [m] is from where it was there."""
    from scipy.spatial import KDTree  # noqa: PLC0415 (heavy)

    known, there = np.isfinite(tips).all(axis=-1), np.isfinite(seen).all(axis=-1)
    distances, places = KDTree(others[there].reshape(there.sum(), -1)).query(cables[known].reshape(known.sum(), -1))
    near = distances <= np.quantile(distances, NEAREST)
    return (tips[known] - seen[there][places])[near]
