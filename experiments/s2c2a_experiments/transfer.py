"""Transfer of networks between arms of one kind: other mismatch, other module counts.

Each randomized arm learns from a whole recording, and from a short one or none: from
scratch, from the networks of another arm, and from a prior over further arms.
Recordings come from new arms, runs from the same arms aged (docs/results/protocol.md).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import NamedTuple

from s2c2a import jobs
from s2c2a.arm import ArmSpec, Module, randomized_arm
from s2c2a.data import CollectOptions
from s2c2a.errors import S2C2AError
from s2c2a.evaluation import Row
from s2c2a.models.transfer import interpolation_weights
from s2c2a.strategies import recipe_named
from s2c2a_experiments.randomized_arms import AGED, over_arms
from s2c2a_experiments.run_rows import labeled
from s2c2a_experiments.transferred_networks import TransferredNetworks

EXPERIMENT = "transfer"
BEST = recipe_named("best")
EPISODE = 100  # samples
HALF_BEND_DEG = 30.0
FULL = "whole recording"
SCRATCH = "from scratch"
ANOTHER = "from another"
PRIOR = "from a prior"
STARTS = (SCRATCH, ANOTHER, PRIOR)


class ArmPair(NamedTuple):
    """An arm of the study and what its training starts from.

    Attributes:
        arm: the new arm.
        other: the arm whose networks it starts from.
        nominal: the arm that the new one is a variant of, for the prior.
    """

    arm: ArmSpec
    other: ArmSpec
    nominal: ArmSpec


class Method(NamedTuple):
    """What networks learn from.

    Attributes:
        start: `FULL` or one of `STARTS`.
        samples: of the short recording; 0 for none.
    """

    start: str
    samples: int = 0

    @property
    def name(self) -> str:
        """Name in the result rows."""
        if self.start == FULL:
            return FULL
        return f"{self.start}, {self.samples} samples"


@dataclass(frozen=True)
class Transfer:
    """Arms and tasks of the study.

    Attributes:
        base: the arm whose mismatch is randomized.
        arm_seeds: seeds of randomized arms with the modules of the base, each of which
            starts from the networks of the next.
        counts: number of half modules of the arm with networks, and of the new arm.
        halves: seeds of randomized arms with either number of half modules.
        strength: of the mismatch.
        tasks: names.
        samples: lengths of the short recordings, in multiples of `EPISODE`; 0 for none.
        seed: of data, training and start.
        prior: number of arms of the prior; 0 for no prior.
    """

    base: ArmSpec
    arm_seeds: tuple[int, ...] = (0, 20, 21)
    counts: tuple[int, int] = (4, 6)
    halves: tuple[int, ...] = (20, 21)
    strength: float = 0.5
    tasks: tuple[str, ...] = ("circle", "tilt-50")
    samples: tuple[int, ...] = (0, 500)
    seed: int = 0
    prior: int = 24

    def __post_init__(self):
        """Validate the options.

        Raises:
            S2C2AError: a single arm, no task, or samples that are no whole episodes.
        """
        uneven = [count for count in self.samples if count % EPISODE or count < 0]
        if len(self.arm_seeds) == 1 or not self.tasks or uneven:
            raise S2C2AError(
                f"{len(self.arm_seeds)} arms, {len(self.tasks)} tasks and {self.samples} "
                "samples; give no arm or at least two, at least one task, and "
                f"multiples of {EPISODE} samples, or 0"
            )

    @property
    def methods(self) -> list[Method]:
        """All methods; nothing is learned from scratch without a recording."""
        starts = STARTS if self.prior else (SCRATCH, ANOTHER)
        methods = [Method(start, count) for start in starts for count in self.samples]
        nothing = Method(SCRATCH, samples=0)
        return [Method(FULL), *(method for method in methods if method != nothing)]

    def short(self, samples: int) -> CollectOptions:
        """Options of a short recording: motor babbling, as stages need more samples."""
        episodes = samples // EPISODE
        return CollectOptions("motor", episodes, EPISODE, self.seed, BEST.speeds)

    def pairs(self) -> list[ArmPair]:
        """Arms of the same module count."""
        arms = [
            randomized_arm(self.base, seed, self.strength) for seed in self.arm_seeds
        ]
        others = arms[1:] + arms[:1]
        return [
            ArmPair(arm, other, self.base)
            for arm, other in zip(arms, others, strict=True)
        ]

    def longer(self) -> list[ArmPair]:
        """Arms of other module counts."""
        old, new = (of_halves(self.base, count) for count in self.counts)
        pairs = []
        for seed in self.halves:
            arm = randomized_arm(new, seed, self.strength)
            other = randomized_arm(old, seed, self.strength)
            pairs.append(ArmPair(arm, other, new))
        return pairs


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
        modules = f"{pairs[0].arm.module_count} modules"
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
        (method, _jobs(study, pair, method))
        for pair in pairs
        for method in study.methods
    ]
    # first all runs that must succeed, together, so that they can run in parallel
    required = [group for method, group in groups if method.start != SCRATCH]
    make(list(chain.from_iterable(required)))
    rows = []
    for method, group in groups:
        try:
            runs = make(group)
        except S2C2AError:
            if method.start != SCRATCH:
                raise
            continue  # too few samples to train from scratch
        rows.append(labeled(jobs.score_rows(EXPERIMENT, runs), method.name))
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


def _jobs(study: Transfer, pair: ArmPair, method: Method) -> list[jobs.Job]:
    """Runs of one arm with the networks of one method."""
    weights = None
    if method.start != FULL:
        options = study.short(method.samples) if method.samples else None
        weights = TransferredNetworks(
            BEST.seen_arm(pair.arm),
            BEST,
            study.seed,
            _start(study, pair, method),
            options,
        )
    return jobs.jobs_for(
        study.tasks, pair.arm, ["s2c2a"], [study.seed], BEST, AGED, weights
    )


def _start(
    study: Transfer, pair: ArmPair, method: Method
) -> jobs.NetworksArtifact | jobs.PriorNetworks | None:
    """Networks that a training starts from; None from scratch."""
    if method.start == ANOTHER:
        return jobs.NetworksArtifact(BEST.seen_arm(pair.other), BEST, study.seed)
    if method.start == PRIOR:
        nominal = BEST.seen_arm(pair.nominal)
        return jobs.PriorNetworks(
            nominal, BEST, study.seed, study.prior, study.strength
        )
    return None
