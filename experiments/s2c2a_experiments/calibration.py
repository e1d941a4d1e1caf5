"""Comparison of an arm with the paper's (docs/results/protocol.md; Chen et al. 2025, II-D).

Makes rows of estimation errors and workspace extents.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.data import CollectOptions, Recording
from s2c2a.errors import ArmError, counted
from s2c2a.estimation import configuration_map_for
from s2c2a.evaluation import Row, angles_deg, position_errors, rollout
from s2c2a.jobs import Cache, Heading, Make, RecordingArtifact, in_groups, made
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.spaces import POSITION
from s2c2a.strategies import Recipe, pcc_strategy, recipe_named, train_s2c2a
from s2c2a.tasks import load_task


@dataclass(frozen=True)
class Claim:
    """A quantity that the paper prints for its arm.

    Attributes:
        quantity: its name.
        paper: the printed value, in `unit`.
        tolerance: largest relative difference of a simulated arm that matches.
        unit: of the value.
    """

    quantity: str
    paper: float
    tolerance: float
    unit: str

    def holds(self, value: float) -> bool:
        """Whether a value is within the tolerance."""
        return abs(value / self.paper - 1.0) <= self.tolerance


def _claims(
    quantity: str, values: dict[str, float], tolerance: float, unit: str
) -> tuple[Claim, ...]:
    return tuple(
        Claim(quantity.format(name), value, tolerance, unit)
        for name, value in values.items()
    )


ESTIMATION = _claims(
    "estimation error {}, mean", {"I": 2.6, "II": 5.1, "III": 8.9}, 0.25, "deg"
)
LARGEST = _claims(
    "estimation error {}, largest", {"I": 8.8, "II": 19.6, "III": 36.3}, np.inf, "deg"
)
"""Reported only."""
WORKSPACE = _claims("workspace {}", {"x": 0.92, "y": 0.92, "z": 0.39}, 0.15, "m")
PCC_CIRCLE = Claim("pcc on circle", 2.5, 0.30, "cm")
C2S_ERROR = Claim("NN_C2S held out", 1.93, 0.30, "%")
EXTENTS = {
    "staged": tuple(claim.paper for claim in WORKSPACE),
    "motor": (0.87, 0.87, 0.34),
}
"""Babbling -> printed extent of the tip's workspace along x, y and z [m]."""


def measure(
    arm: ArmSpec, seed: int, with_pcc: bool, with_network: bool
) -> dict[str, float]:
    """Measure the claimed quantities of an arm on a new staged recording.

    Args:
        arm: the arm to simulate.
        seed: of data, training and start.
        with_pcc: also run `pcc` on the circle.
        with_network: also train NN_C2S.

    Returns:
        Quantity -> value, in the units of the claims.
    """
    with TemporaryDirectory() as folder:
        artifact = RecordingArtifact(arm, CollectOptions(seed=seed))
        recording = made(artifact, Cache(Path(folder)))
    values = measured(recording)
    recipe = recipe_named("paper")
    if with_pcc:
        task = load_task("circle", arm)
        strategy = pcc_strategy(arm, recipe.planner)
        run = rollout(SimulatedRobot(arm, seed=seed), strategy, task)
        errors = position_errors(run.after("states"), task.desired_positions())
        values[PCC_CIRCLE.quantity] = float(errors.mean())
    if with_network:
        networks = train_s2c2a(recording, recipe, seed)
        values[C2S_ERROR.quantity] = networks.trained["C2S"].percent[0]
    return values


def mean_measurements(arm: ArmSpec, seeds: Sequence[int]) -> dict[str, float]:
    """Means over seeds of `measure`, for the quantities that `claims_for` lists."""
    full = PCC_CIRCLE in claims_for(arm)
    per_seed = [measure(arm, seed, full, full) for seed in seeds]
    return {
        name: sum(values[name] for values in per_seed) / len(per_seed)
        for name in per_seed[0]
    }


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


def check_comparable(arm: ArmSpec) -> None:
    """Raise ArmError for an arm whose quantities the paper does not print."""
    if arm.module_count != len(ESTIMATION) or arm.sensing != "encoders":
        raise ArmError(
            f"{arm.name} has {counted(arm.module_count, 'module')} and sensing by "
            f"'{arm.sensing}'; choose an arm with {len(ESTIMATION)} modules and "
            "encoders, like the paper's arm"
        )


def claims_for(arm: ArmSpec) -> tuple[Claim, ...]:
    """Claims for an arm; those of NN_C2S and pcc count for `twin_arm` only."""
    claims = ESTIMATION + WORKSPACE
    if arm.name == "twin_arm":
        return (*claims, PCC_CIRCLE, C2S_ERROR)
    return claims


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
