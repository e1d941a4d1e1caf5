"""What the paper says of its arm, and arms that behave like that (docs/protocol.md; Chen et al. 2025, sec. II-D).

How wrong sensors are and how far an arm reaches, as rows; and the search for a twin
that is like the paper's.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from pydantic import ValidationError
from scipy.optimize import minimize

from s2c2a.arm import ArmSpec
from s2c2a.data import CollectOptions, Recording
from s2c2a.errors import ArmError, SimulationError
from s2c2a.evaluation import Row, angles_deg, position_errors, rollout
from s2c2a.jobs import Cache, Heading, Make, RecordingArtifact, in_groups, made
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.sensing import estimator_for
from s2c2a.spaces import POSITION
from s2c2a.strategies import Recipe, pcc_strategy, recipe_named, train_s2c2a
from s2c2a.tasks import task_named


@dataclass(frozen=True)
class Claim:
    """One thing that the paper says of its arm, and how near a twin must come."""

    quantity: str
    paper: float
    tolerance: float
    unit: str

    def holds(self, value: float) -> bool:
        """Whether a value is near enough."""
        return abs(value / self.paper - 1.0) <= self.tolerance


def _claims(
    quantity: str, papers: dict[str, float], tolerance: float, unit: str
) -> tuple[Claim, ...]:
    return tuple(
        Claim(quantity.format(name), paper, tolerance, unit)
        for name, paper in papers.items()
    )


ESTIMATION = _claims(
    "estimation error {}, mean", {"I": 2.6, "II": 5.1, "III": 8.9}, 0.25, "deg"
)
LARGEST = _claims(
    "estimation error {}, largest", {"I": 8.8, "II": 19.6, "III": 36.3}, np.inf, "deg"
)
"""Reported, not tuned."""
WORKSPACE = _claims("workspace {}", {"x": 0.92, "y": 0.92, "z": 0.39}, 0.15, "m")
PCC_CIRCLE = Claim("pcc on circle", 2.5, 0.30, "cm")
C2S_ERROR = Claim("NN_C2S held out", 1.93, 0.30, "%")
EXTENTS = {
    "staged": tuple(claim.paper for claim in WORKSPACE),
    "motor": (0.87, 0.87, 0.34),
}
"""Babbling -> extent of the tip's workspace that the paper prints [m]."""


def measure(
    arm: ArmSpec, seed: int, with_pcc: bool, with_network: bool
) -> dict[str, float]:
    """Quantities of the claims above, and the largest estimation errors, from a fresh staged recording."""
    with TemporaryDirectory() as folder:
        recording = made(
            RecordingArtifact(arm, CollectOptions(seed=seed)), Cache(Path(folder))
        )
    values = measured(recording)
    if with_pcc:
        strategy = pcc_strategy(arm, recipe_named("paper").planner)
        task = task_named("circle", arm)
        run = rollout(SimulatedRobot(arm, seed=seed), strategy, task)
        values[PCC_CIRCLE.quantity] = float(
            position_errors(run.after("states"), task.desired_positions()).mean()
        )
    if with_network:
        values[C2S_ERROR.quantity] = train_s2c2a(
            recording, recipe_named("paper"), seed
        ).percent["C2S"][0]
    return values


def mean_measured(
    arm: ArmSpec, seeds: Sequence[int], with_network: bool
) -> dict[str, float]:
    """Means over seeds of what `measure` says, as far as claims ask for it."""
    twin = PCC_CIRCLE in claims_for(arm)
    every = [measure(arm, seed, twin, with_network and twin) for seed in seeds]
    return {
        name: sum(values[name] for values in every) / len(every) for name in every[0]
    }


def measured(recording: Recording) -> dict[str, float]:
    """Estimation errors, their largest ones [deg], and the extent of the tip's workspace [m]."""
    angles = estimation_errors_deg(recording)
    extents = np.ptp(
        recording.sensor("states")[..., -1, POSITION].reshape(-1, 3), axis=0
    )
    every = np.concatenate([angles.mean(axis=(0, 1)), extents, angles.max(axis=(0, 1))])
    claims = ESTIMATION + WORKSPACE + LARGEST
    return {
        claim.quantity: float(value) for claim, value in zip(claims, every, strict=True)
    }


def estimation_errors_deg(recording: Recording) -> np.ndarray:
    """Angle between sensed and true configurations, shape (episodes, samples, modules)."""
    sensed = estimator_for(recording.arm).sensed(recording.readings())
    return angles_deg(recording.sensor("configurations"), sensed)


def check_comparable(arm: ArmSpec) -> None:
    """Raise ArmError where the paper's arm has nothing to be compared with."""
    if arm.module_count != len(ESTIMATION) or arm.sensing != "encoders":
        raise ArmError(
            f"{arm.name} has {arm.module_count} modules and sensors by '{arm.sensing}'; the paper's arm has "
            f"{len(ESTIMATION)} and encoders, so only such an arm can be calibrated to it"
        )


def claims_for(arm: ArmSpec) -> tuple[Claim, ...]:
    """Which claims hold an arm to the paper: the siblings of the twin are not held to those of NN_C2S and pcc."""
    return (
        ESTIMATION
        + WORKSPACE
        + ((PCC_CIRCLE, C2S_ERROR) if arm.name == "twin_arm" else ())
    )


def search(
    arm: ArmSpec,
    seed: int,
    evaluations: int,
    told: Callable[[int, float], None] = lambda *_: None,
) -> ArmSpec:
    """Move stiffnesses and hysteresis until the cheap claims hold as well as they can (Nelder-Mead on logarithms).

    Only what is not zero is moved, so the kind of hysteresis stays.
    """
    claims = [claim for claim in claims_for(arm) if claim is not C2S_ERROR]
    count = 0

    def misfit(logarithms: np.ndarray) -> float:
        nonlocal count
        count += 1
        try:
            values = measure(
                _with_factors(arm, np.exp(logarithms)),
                seed,
                PCC_CIRCLE in claims,
                with_network=False,
            )
        # no such arm, or none that stands
        except (ValidationError, ArmError, SimulationError):
            return np.inf
        total = sum(
            ((values[claim.quantity] / claim.paper - 1) / claim.tolerance) ** 2
            for claim in claims
        )
        told(count, total)
        return total

    start = np.zeros(1 + 2 * arm.module_count)
    simplex = np.vstack([start, start + 0.15 * np.eye(len(start))])
    found = minimize(
        misfit,
        start,
        method="Nelder-Mead",
        options={"maxfev": evaluations, "initial_simplex": simplex},
    )
    return _with_factors(arm, np.exp(found.x))


def _with_factors(arm: ArmSpec, factors: np.ndarray) -> ArmSpec:
    """Bending stiffness of all modules, cable stiffness of each, hysteresis of each, times a factor; three digits."""
    bending, cables, hysteresis = factors[0], *np.split(factors[1:], 2)
    description = arm.model_dump()
    for module, softer, more in zip(
        description["modules"], cables, hysteresis, strict=True
    ):
        module["bending_stiffness"] = _digits(module["bending_stiffness"] * bending)
        cable = module["cable"]
        cable["stiffness"] = _digits(cable["stiffness"] * softer)
        cable |= {
            kind: _digits(np.multiply(cable[kind], more))
            for kind in ("backlash", "friction", "creep")
        }
    return ArmSpec.model_validate(description)


def _digits(values: np.ndarray) -> Any:
    """One or several, to three digits."""
    return np.vectorize(lambda value: float(f"{value:.3g}"))(values).tolist()


def sensing_rows(
    arm: ArmSpec, seeds: Sequence[int], make: Make, recipe: Recipe
) -> tuple[list[Row], Recording]:
    """Extents of staged and motor babbling and estimation errors of every module; and the first staged recording."""
    heading = Heading("workspace", arm, recipe.name, tuple(seeds))
    rows = []
    options = [
        [CollectOptions(name, seed=seed, speeds=recipe.speeds) for seed in seeds]
        for name in EXTENTS
    ]
    every = in_groups(
        make, [[RecordingArtifact(arm, one) for one in group] for group in options]
    )
    for (babbling, extents), recordings in zip(EXTENTS.items(), every, strict=True):
        values = [measured(recording) for recording in recordings]
        printed = [
            (f"{babbling} babbling", claim, wide)
            for claim, wide in zip(WORKSPACE, extents, strict=True)
        ]
        if babbling == "staged":
            errors = (
                claim
                for both in zip(ESTIMATION, LARGEST, strict=True)
                for claim in both
            )
            printed += [("sensors", claim, claim.paper) for claim in errors]
        for source, claim, paper in printed:
            each = [one[claim.quantity] for one in values]
            rows.append(
                heading.row(
                    "data", source, claim.quantity, claim.unit, each, paper_mean=paper
                )
            )
    return rows, every[0][0]
