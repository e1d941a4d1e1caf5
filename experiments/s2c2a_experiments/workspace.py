"""Estimation errors and workspaces beside the paper's (Chen et al. 2025, sec. II-D)."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.data import CollectOptions, Recording
from s2c2a.estimation import configuration_map_for
from s2c2a.evaluation import Row, angles_deg
from s2c2a.jobs import Heading, Make, RecordingArtifact, in_groups
from s2c2a.spaces import POSITION
from s2c2a.strategies import Recipe


class Claim(NamedTuple):
    """A quantity that the paper prints for its arm, its value and its unit."""

    quantity: str
    paper: float
    unit: str


def _claims(quantity: str, values: dict[str, float], unit: str) -> tuple[Claim, ...]:
    return tuple(
        Claim(quantity.format(name), value, unit) for name, value in values.items()
    )


ESTIMATION = _claims(
    "estimation error {}, mean", {"I": 2.6, "II": 5.1, "III": 8.9}, "deg"
)
LARGEST = _claims(
    "estimation error {}, largest", {"I": 8.8, "II": 19.6, "III": 36.3}, "deg"
)
WORKSPACE = _claims("workspace {}", {"x": 0.92, "y": 0.92, "z": 0.39}, "m")
EXTENTS = {
    "staged": tuple(claim.paper for claim in WORKSPACE),
    "motor": (0.87, 0.87, 0.34),
}
"""Babbling -> printed extent of the tip's workspace along x, y and z [m]."""


def measured(recording: Recording) -> dict[str, float]:
    """Mean and largest estimation errors [deg] and extents of the workspace [m]."""
    angles = estimation_errors_deg(recording)
    tips = recording.sensor("states")[..., -1, POSITION].reshape(-1, 3)
    groups = {
        ESTIMATION: angles.mean(axis=(0, 1)),
        WORKSPACE: np.ptp(tips, axis=0),
        LARGEST: angles.max(axis=(0, 1)),
    }
    return {
        claim.quantity: float(value)
        for claims, values in groups.items()
        for claim, value in zip(claims, values, strict=True)
    }


def estimation_errors_deg(recording: Recording) -> np.ndarray:
    """Angle between sensed and true configurations, (episodes, samples, modules)."""
    sensed = configuration_map_for(recording.arm).configurations(recording.readings())
    return angles_deg(recording.sensor("configurations"), sensed)


def sensing_rows(
    arm: ArmSpec, seeds: Sequence[int], make: Make, recipe: Recipe
) -> tuple[list[Row], Recording]:
    """Make rows of workspace extents and estimation errors.

    Args:
        arm: the arm to simulate.
        seeds: of the recordings.
        make: loads or makes recordings.
        recipe: gives the speeds of babbling.

    Returns:
        Rows of staged and motor babbling; and the first staged recording.
    """
    heading = Heading("workspace", arm, recipe.name, tuple(seeds))
    groups = []
    for babbling in EXTENTS:
        options = [
            CollectOptions(babbling, seed=s, speeds=recipe.speeds) for s in seeds
        ]
        groups.append([RecordingArtifact(arm, each) for each in options])
    recordings = dict(zip(EXTENTS, in_groups(make, groups), strict=True))
    rows = []
    for babbling, extents in EXTENTS.items():
        values = [measured(recording) for recording in recordings[babbling]]
        for claim, extent in zip(WORKSPACE, extents, strict=True):
            source = f"{babbling} babbling"
            rows.append(_claim_row(heading, source, claim, extent, values))
        if babbling == "staged":
            for claims in zip(ESTIMATION, LARGEST, strict=True):
                for claim in claims:
                    row = _claim_row(heading, "sensors", claim, claim.paper, values)
                    rows.append(row)
    return rows, recordings["staged"][0]


def _claim_row(
    heading: Heading,
    source: str,
    claim: Claim,
    paper: float,
    values: Sequence[dict[str, float]],
) -> Row:
    per_seed = [quantities[claim.quantity] for quantities in values]
    return heading.row(
        "data", source, claim.quantity, claim.unit, per_seed, paper_mean=paper
    )
