"""How wrong the sensors are, and how far the arm reaches (Chen et al. 2025, sec. II-D)."""

from collections.abc import Sequence

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.data import CollectOptions, Recording
from s2c2a.evaluation.report import Row, over_seeds
from s2c2a.experiments.calibration import ESTIMATION, LARGEST, WORKSPACE, estimation_errors_deg
from s2c2a.experiments.workshop import Workshop
from s2c2a.spaces import POSITION
from s2c2a.strategies import Recipe

EXTENTS = {"staged": tuple(line.paper for line in WORKSPACE), "motor": (0.87, 0.87, 0.34)}
"""Babbling -> extent of the tip's workspace that the paper prints [m]."""


def sensing_rows(experiment: str, arm: ArmSpec, seeds: Sequence[int], workshop: Workshop, recipe: Recipe) -> list[Row]:
    """Estimation errors of every module, and the extents of staged and motor babbling."""
    rows = []
    for babbling, extents in EXTENTS.items():
        options = [CollectOptions(babbling, seed=seed, speeds=recipe.speeds) for seed in seeds]
        recordings = [workshop.recording(arm, option) for option in options]
        reached = [np.ptp(one.states[..., -1, POSITION].reshape(-1, 3), axis=0) for one in recordings]
        for axis, name in enumerate("xyz"):
            values = [float(extent[axis]) for extent in reached]
            rows.append(
                _row(
                    experiment,
                    arm,
                    f"{babbling} babbling",
                    recipe,
                    f"workspace {name}",
                    "m",
                    values,
                    seeds,
                    extents[axis],
                )
            )
        if babbling == "staged":
            rows += _estimation_rows(experiment, arm, recordings, seeds, recipe)
    return rows


def _estimation_rows(experiment, arm: ArmSpec, recordings: Sequence[Recording], seeds, recipe: Recipe) -> list[Row]:
    angles = [estimation_errors_deg(recording) for recording in recordings]
    rows = []
    for module, (line, (name, largest)) in enumerate(zip(ESTIMATION, LARGEST.items(), strict=True)):
        means = [float(angle[..., module].mean()) for angle in angles]
        tops = [float(angle[..., module].max()) for angle in angles]
        for metric, values, printed in (("mean", means, line.paper), ("largest", tops, largest)):
            what = f"estimation error {name}, {metric}"
            rows.append(_row(experiment, arm, "sensors", recipe, what, "deg", values, seeds, printed))
    return rows


def _row(experiment, arm: ArmSpec, controller, recipe: Recipe, metric, unit, values, seeds, printed: float) -> Row:
    return Row(
        experiment=experiment,
        task="data",
        arm=arm.name,
        fidelity="fast",
        controller=controller,
        recipe=recipe.name,
        metric=metric,
        unit=unit,
        **over_seeds(values),
        seeds=tuple(seeds),
        paper_mean=printed,
    )
