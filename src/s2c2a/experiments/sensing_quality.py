"""How wrong the sensors are, and how far the arm reaches (Chen et al. 2025, sec. II-D)."""

from collections.abc import Sequence

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.data import CollectOptions, Recording
from s2c2a.evaluation.metrics import configuration_errors_deg
from s2c2a.evaluation.report import Row, over_seeds
from s2c2a.experiments.workshop import Workshop
from s2c2a.sensing import estimator_for
from s2c2a.spaces import POSITION
from s2c2a.strategies import Recipe

ESTIMATION = {"I": (2.6, 8.8), "II": (5.1, 19.6), "III": (8.9, 36.3)}
"""Module -> mean and largest estimation error that the paper prints [deg]."""
WORKSPACE = {"staged": (0.92, 0.92, 0.39), "motor": (0.87, 0.87, 0.34)}
"""Babbling -> extent of the tip's workspace that the paper prints [m]."""


def sensing_rows(experiment: str, arm: ArmSpec, seeds: Sequence[int], workshop: Workshop, recipe: Recipe) -> list[Row]:
    """Estimation errors of every module, and the extents of staged and motor babbling."""
    rows = []
    for babbling, extents in WORKSPACE.items():
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


def estimation_errors_deg(recording: Recording) -> np.ndarray:
    """Angle between sensed and true configurations, shape (episodes, samples, modules)."""
    sensed = np.asarray(estimator_for(recording.arm)(recording.cables, recording.configurations))
    return configuration_errors_deg(recording.configurations, sensed)


def _estimation_rows(experiment, arm: ArmSpec, recordings: Sequence[Recording], seeds, recipe: Recipe) -> list[Row]:
    angles = [estimation_errors_deg(recording) for recording in recordings]
    rows = []
    for module, (name, (mean, largest)) in enumerate(ESTIMATION.items()):
        means = [float(angle[..., module].mean()) for angle in angles]
        tops = [float(angle[..., module].max()) for angle in angles]
        for metric, values, printed in (("mean", means, mean), ("largest", tops, largest)):
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
