"""Transfer of networks between arms of one kind: other mismatch, other module counts.

Each randomized arm learns from a whole recording, from a short one, and from a short
one or none with the networks of another arm as the starting point. Recordings come from
new arms, runs from the same arms aged (docs/protocol.md).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain

from s2c2a import jobs
from s2c2a.arm import ArmSpec, Module, randomized_arm
from s2c2a.data import CollectOptions
from s2c2a.errors import S2C2AError
from s2c2a.evaluation import Row
from s2c2a.models.transfer import interpolation_weights
from s2c2a.strategies import recipe_named
from s2c2a.studies.randomized_arms import AGED, over_arms

EXPERIMENT = "transfer"
BEST = recipe_named("best")
EPISODE = 100  # samples
HALF_BEND_DEG = 30.0
FULL = "whole recording"
SCRATCH = "from scratch"
ANOTHER = "from another"
NOTHING = "nothing recorded"
METHODS = (FULL, SCRATCH, ANOTHER, NOTHING)

ArmPair = tuple[ArmSpec, ArmSpec]
"""The new arm, and the arm whose networks it starts from."""


@dataclass(frozen=True)
class Transfer:
    """Arms and tasks of the study.

    Attributes:
        base: the arm whose mismatch is randomized.
        drawn: seeds of arms, each of which starts from the networks of the next.
        counts: modules of the arm with networks, and of the new arm.
        halves: seeds of arms of either count.
        strength: of the mismatch.
        tasks: names.
        samples: of a short recording.
        seed: of data, training and start.
    """

    base: ArmSpec
    drawn: tuple[int, ...] = (0, 20, 21)
    counts: tuple[int, int] = (4, 6)
    halves: tuple[int, ...] = (20, 21)
    strength: float = 0.5
    tasks: tuple[str, ...] = ("circle", "tilt-50")
    samples: int = 500
    seed: int = 0

    def __post_init__(self):
        """Validate the options."""
        if len(self.drawn) == 1 or not self.tasks or self.samples < EPISODE:
            raise S2C2AError(
                f"{len(self.drawn)} arms, {len(self.tasks)} tasks and {self.samples} "
                "samples; give no arm or at least two, at least one task, and at "
                f"least {EPISODE} samples"
            )

    @property
    def short(self) -> CollectOptions:
        """Options of a short recording: motor babbling, as stages need more samples."""
        episodes = self.samples // EPISODE
        return CollectOptions("motor", episodes, EPISODE, self.seed, BEST.speeds)

    def pairs(self) -> list[ArmPair]:
        """Arms of the same module count."""
        arms = [randomized_arm(self.base, seed, self.strength) for seed in self.drawn]
        return list(zip(arms, arms[1:] + arms[:1], strict=True))

    def longer(self) -> list[ArmPair]:
        """Arms of other module counts."""
        old, new = (of_halves(self.base, count) for count in self.counts)
        return [
            (
                randomized_arm(new, seed, self.strength),
                randomized_arm(old, seed, self.strength),
            )
            for seed in self.halves
        ]


def of_halves(arm: ArmSpec, count: int) -> ArmSpec:
    """An arm of modules with half the length and mass, so that six replace three.

    Args:
        arm: gives modules, and cable properties along the arm.
        count: of half modules.
    """
    modules = []
    for number, weights in enumerate(interpolation_weights(arm.module_count, count)):
        cable = {}
        for key in ("stiffness", "backlash"):
            values = [getattr(module.cable, key) for module in arm.modules]
            cable[key] = round(float(weights @ values), 6)
        modules.append(_half(arm.modules[number % 2], cable))
    update = {
        "name": f"half_{count}",
        "description": f"{count} modules of half the twin's length",
        "modules": tuple(modules),
    }
    return arm.model_copy(update=update)


def _half(module: Module, cable: dict[str, float]) -> Module:
    update = {
        "length": module.length / 2,
        "mass": module.mass / 2,
        "bend_limit_deg": HALF_BEND_DEG,
        "cable": module.cable.model_copy(update=cable),
    }
    return module.model_copy(update=update)


def transfer_rows(study: Transfer, make: jobs.Make) -> list[Row]:
    """Make rows of every arm and method, their means and worst, and their ratios.

    Args:
        study: arms and tasks.
        make: loads or makes runs, networks and recordings.
    """
    rows = []
    for pairs in (study.pairs(), study.longer()):
        rows_of_arms = _rows_of_arms(study, pairs, make)
        if not rows_of_arms:
            continue
        modules = f"{pairs[0][0].module_count} modules"
        summary = [
            replace(row, arm=f"{row.arm}, {modules}")
            for row in over_arms(rows_of_arms, study.strength)
        ]
        rows += ratios(summary) + summary + list(chain.from_iterable(rows_of_arms))
    return rows


def _rows_of_arms(
    study: Transfer, pairs: Sequence[ArmPair], make: jobs.Make
) -> list[list[Row]]:
    """Rows of each pair and method; none where training from scratch fails."""
    groups = [
        (method, _jobs(study, pair, method)) for pair in pairs for method in METHODS
    ]
    # first all runs that must succeed, together, so that they can run in parallel
    make([job for method, group in groups if method != SCRATCH for job in group])
    rows = []
    for method, group in groups:
        try:
            runs = make(group)
        except S2C2AError:
            if method != SCRATCH:
                raise
            continue  # too few samples to train from scratch
        scores = jobs.score_rows(EXPERIMENT, runs)
        rows.append(
            [
                replace(row, strategy=method, paper_mean=None, paper_std=None)
                for row in scores
            ]
        )
    return rows


def ratios(rows: Sequence[Row]) -> list[Row]:
    """Mean errors of each method, divided by those with a whole recording."""
    references = {
        (row.arm, row.task, row.metric): row.mean
        for row in rows
        if row.strategy == FULL
    }
    ratio_rows = []
    for row in rows:
        reference = references.get((row.arm, row.task, row.metric))
        averaged = row.arm.startswith("mean")
        if row.strategy != FULL and averaged and reference is not None:
            ratio_rows.append(replace(row, unit="times", mean=row.mean / reference))
    return ratio_rows


def _jobs(study: Transfer, pair: ArmPair, method: str) -> list[jobs.Job]:
    """Runs of one arm with the networks of one method."""
    arm, other = pair
    weights = None
    if method != FULL:
        start = jobs.NetworksArtifact(BEST.planning_arm(other), BEST, study.seed)
        weights = jobs.TransferredNetworks(
            BEST.planning_arm(arm),
            BEST,
            study.seed,
            None if method == SCRATCH else start,
            None if method == NOTHING else study.short,
        )
    return jobs.jobs_for(study.tasks, arm, ["s2c2a"], [study.seed], BEST, AGED, weights)
