"""What networks of one arm are worth to another of the same make: other mismatch, and other module counts.

Arms are drawn; each learns from a whole recording, from a short one, and from a short
one and the networks of another. Recordings are of arms when they are young, runs of the
same arms aged (docs/protocol.md).
"""

from collections.abc import Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass, replace

from s2c2a import jobs
from s2c2a.arm import ArmSpec, randomized_arm
from s2c2a.data import CollectOptions
from s2c2a.errors import S2C2AError
from s2c2a.evaluation import Row
from s2c2a.models.transfer import same_places
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


@dataclass(frozen=True)
class Transfer:
    """What is tried.

    Attributes:
        base: whose mismatch are drawn.
        drawn: seeds of arms, each of which begins from the networks of the next.
        counts: of modules, of arms that are learned from, and that begin.
        halves: seeds of arms of either count.
        strength: of mismatch.
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
        """Refuse what cannot be tried."""
        if len(self.drawn) == 1 or not self.tasks or self.samples < EPISODE:
            raise S2C2AError(
                f"{len(self.drawn)} arms, {len(self.tasks)} tasks and {self.samples} samples asked for; take two arms "
                f"or more, or none, at least a task, and {EPISODE} samples"
            )

    @property
    def short(self) -> CollectOptions:
        """How a short recording is collected: every module by itself, for there is no time for stages."""
        return CollectOptions(
            "motor", self.samples // EPISODE, EPISODE, self.seed, BEST.speeds
        )

    def pairs(self) -> list[tuple[ArmSpec, ArmSpec]]:
        """Arms that begin, and whose networks they begin from."""
        drawn = [randomized_arm(self.base, seed, self.strength) for seed in self.drawn]
        return list(zip(drawn, drawn[1:] + drawn[:1], strict=True))

    def longer(self) -> list[tuple[ArmSpec, ArmSpec]]:
        """The same of other module counts."""
        old, new = (of_halves(self.base, count) for count in self.counts)
        return [
            (
                randomized_arm(new, seed, self.strength),
                randomized_arm(old, seed, self.strength),
            )
            for seed in self.halves
        ]


def of_halves(arm: ArmSpec, count: int) -> ArmSpec:
    """So many modules of half the length and mass of an arm's, cables as along it: six stand where three do."""
    places = same_places(arm.module_count, count)
    modules = []
    for number, place in enumerate(places):
        cable = {
            key: round(
                float(place @ [getattr(one.cable, key) for one in arm.modules]), 6
            )
            for key in ("stiffness", "play")
        }
        half = arm.modules[number % 2]
        changes = {
            "length": half.length / 2,
            "mass": half.mass / 2,
            "bend_limit_deg": HALF_BEND_DEG,
        }
        modules.append(
            half.model_copy(
                update=changes | {"cable": half.cable.model_copy(update=cable)}
            )
        )
    about = f"{count} modules of half the twin's length"
    return arm.model_copy(
        update={
            "name": f"half_{count}",
            "description": about,
            "modules": tuple(modules),
        }
    )


def transfer_rows(asked: Transfer, make: jobs.Make) -> list[Row]:
    """Rows of every arm and way to learn, of means and the worst over arms, and of how much that is over the whole's.

    Args:
        asked: what is tried.
        make: finds or makes runs, networks and recordings.
    """
    rows = []
    for pairs in (asked.pairs(), asked.longer()):
        tried = [
            (pair, way) for pair in pairs for way in (FULL, SCRATCH, ANOTHER, NOTHING)
        ]
        # all side by side
        make(
            [
                job
                for pair, way in tried
                if way != SCRATCH
                for job in _jobs(asked, *pair, way)
            ]
        )
        every = [
            _made(make, _jobs(asked, *pair, way), may_fail=way == SCRATCH)
            for pair, way in tried
        ]
        found = [
            _named(jobs.score_rows(EXPERIMENT, runs), way)
            for (_, way), runs in zip(tried, every, strict=True)
            if runs
        ]
        if found:
            summed = [
                replace(row, arm=f"{row.arm}, {pairs[0][0].module_count} modules")
                for row in over_arms(found, asked.strength)
            ]
            rows += ratios(summed) + summed + [row for one in found for row in one]
    return rows


def _made(make: jobs.Make, asked: Sequence[jobs.Job], may_fail: bool) -> list[jobs.Run]:
    """Runs; none where so few samples could not be learned from."""
    with suppress(S2C2AError) if may_fail else nullcontext():
        return make(asked)
    return []


def ratios(rows: Sequence[Row]) -> list[Row]:
    """Errors over those of a whole recording."""
    whole = {
        (row.arm, row.task, row.metric): row.mean
        for row in rows
        if row.strategy == FULL
    }
    return [
        replace(row, unit="times", mean=row.mean / whole[of])
        for row in rows
        if row.strategy != FULL
        and row.arm.startswith("mean")
        and (of := (row.arm, row.task, row.metric)) in whole
    ]


def _jobs(asked: Transfer, arm: ArmSpec, other: ArmSpec, way: str) -> list[jobs.Job]:
    """Runs of one arm."""
    given = None
    start = jobs.NetworksArtifact(BEST.felt(other), BEST, asked.seed)
    if way != FULL:
        begun = None if way == SCRATCH else start
        options = None if way == NOTHING else asked.short
        given = jobs.BegunNetworks(BEST.felt(arm), BEST, asked.seed, begun, options)
    return jobs.jobs_for(asked.tasks, arm, ["s2c2a"], [asked.seed], BEST, AGED, given)


def _named(rows: Sequence[Row], way: str) -> list[Row]:
    return [replace(row, strategy=way, paper_mean=None, paper_std=None) for row in rows]
