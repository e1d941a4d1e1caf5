"""How wrong the sensors are, and how far the arm reaches (Chen et al. 2025, sec. II-D)."""

from collections.abc import Sequence

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.data import CollectOptions, Recording
from s2c2a.evaluation.report import Row
from s2c2a.jobs import Heading, Make, RecordingArtifact, in_groups
from s2c2a.spaces import POSITION
from s2c2a.strategies import Recipe
from s2c2a.studies.calibration import ESTIMATION, LARGEST, WORKSPACE, estimation_errors_deg

EXTENTS = {"staged": tuple(claim.paper for claim in WORKSPACE), "motor": (0.87, 0.87, 0.34)}
"""Babbling -> extent of the tip's workspace that the paper prints [m]."""


def sensing_rows(
    experiment: str, arm: ArmSpec, seeds: Sequence[int], make: Make, recipe: Recipe
) -> tuple[list[Row], Recording]:
    """Extents of staged and motor babbling and estimation errors of every module; and the first staged recording."""
    heading, rows = Heading(experiment, arm, recipe.name, tuple(seeds)), []
    options = [[CollectOptions(name, seed=seed, speeds=recipe.speeds) for seed in seeds] for name in EXTENTS]
    every = in_groups(make, [[RecordingArtifact(arm, one) for one in group] for group in options])
    for (babbling, extents), recordings in zip(EXTENTS.items(), every, strict=True):
        reached = [np.ptp(one.sensor("states")[..., -1, POSITION].reshape(-1, 3), axis=0) for one in recordings]
        for axis, (name, extent) in enumerate(zip("xyz", extents, strict=True)):
            values = [float(extents[axis]) for extents in reached]
            rows.append(
                heading.row("data", f"{babbling} babbling", f"workspace {name}", "m", values, paper_mean=extent)
            )
        if babbling == "staged":
            rows += _estimation_rows(heading, recordings)
    return rows, every[0][0]


def _estimation_rows(heading: Heading, recordings: Sequence[Recording]) -> list[Row]:
    angles = [estimation_errors_deg(recording) for recording in recordings]
    rows = []
    for module, (claim, (name, largest)) in enumerate(zip(ESTIMATION, LARGEST.items(), strict=True)):
        means = [float(angle[..., module].mean()) for angle in angles]
        tops = [float(angle[..., module].max()) for angle in angles]
        for metric, values, printed in (("mean", means, claim.paper), ("largest", tops, largest)):
            what = f"estimation error {name}, {metric}"
            rows.append(heading.row("data", "sensors", what, "deg", values, paper_mean=printed))
    return rows
