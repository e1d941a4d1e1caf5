"""Runs made ahead by a crew, first what they are made with: tables then find both where they look for them.

A table is cut into one shard for every file of the workshop that is missing (a recording, trained networks) and one for
every controller and seed whose runs are missing. A shard works in an empty folder of its own with copies of the files
that it needs, and hands back the files that it made: it needs no common disk, and leaves nothing behind.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeVar

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError
from s2c2a.evaluation.rollout_files import load_rollout
from s2c2a.experiments.following import Conditions, Shelf, asked_of, follow, workshop_strategies
from s2c2a.experiments.parcels import Parcel, packed, unpack
from s2c2a.experiments.workshop import Need, Workshop, need_of
from s2c2a.shards import Crew, as_done
from s2c2a.strategies import Recipe
from s2c2a.tasks import Task

Kind = TypeVar("Kind", "Job", Need)
Work = Callable[[tuple[Kind, Parcel]], Parcel]


@dataclass(frozen=True)
class Job:
    """Runs of one controller with one seed, one after the other.

    Attributes:
        tasks: some by name.
        arm: the arm to simulate.
        controller: its name.
        seed: of data, training and start.
        recipe: how networks are trained and plans made.
        conditions: simulation, payload, guard.
    """

    tasks: tuple[str | Task, ...]
    arm: ArmSpec
    controller: str
    seed: int
    recipe: Recipe
    conditions: Conditions = field(default_factory=Conditions)


def jobs_for(
    tasks: Sequence[str | Task],
    arm: ArmSpec,
    controllers: Sequence[str],
    seeds: Sequence[int],
    recipe: Recipe,
    conditions: Conditions | None = None,
) -> list[Job]:
    """One for every controller and seed; the arguments of `following.follow`."""
    under, asked = conditions or Conditions(), tuple(dict.fromkeys(tasks))
    return [Job(asked, arm, controller, seed, recipe, under) for seed in seeds for controller in controllers]


def make_ahead(
    jobs: Sequence[Job], folder: Path, workshop: Workshop, crew: Crew, needs: Iterable[Need] = ()
) -> list[tuple[Job, S2C2AError]]:
    """Make runs that are missing on the shelves of their recipes, and what they and others need.

    Args:
        jobs: the runs.
        folder: of the shelves.
        workshop: where data and networks are kept; told of progress.
        crew: who does the work.
        needs: other files of the workshop that will be wanted.

    Returns:
        Jobs that failed and why; all others were done.

    Raises:
        S2C2AError: a task is not known, or the crew failed; what was whole is kept.
    """
    missing = [job for job in (_unfinished(job, folder) for job in jobs) if job.tasks]
    wanted = [*needs, *(need for job in missing if (need := _need(job)))]
    lacking = {workshop.file(need): need for need in wanted if not workshop.has(need)}
    data = {workshop.file(need): need for need in (replace(lack, kind="recording") for lack in lacking.values())}
    first = [need for need in data.values() if not workshop.has(need)]  # once, whatever is trained on them
    make = partial(_make, workshop.fidelity)
    unmade = _each(crew, make, first, workshop, workshop.folder, "recordings")
    then = [need for need in lacking.values() if need.kind != "recording"]
    unmade += _each(crew, make, then, workshop, workshop.folder, "networks")
    why = {workshop.file(need): error for need, error in unmade}
    lost = [(job, why[path]) for job in missing if (path := _file(job, workshop)) in why]
    possible = [job for job in missing if _file(job, workshop) not in why]
    return lost + _each(crew, partial(_run, workshop.fidelity), possible, workshop, folder, "runs")


def make_all_ahead(
    jobs: Sequence[Job], folder: Path, workshop: Workshop, crew: Crew, needs: Iterable[Need] = ()
) -> None:
    """The same, where all are wanted.

    Raises:
        S2C2AError: as above, or a job failed.
    """
    if failed := make_ahead(jobs, folder, workshop, crew, needs):
        job, error = failed[0]
        raise S2C2AError(
            f"{len(failed)} of {len(jobs)} jobs failed, such as {job.controller} with {job.arm.name}, seed {job.seed}: "
            f"{error}; what was whole is kept"
        ) from error


def shelf_for(recipe: Recipe, folder: Path) -> Shelf:
    """Where runs of a recipe are kept."""
    return Shelf(folder, {"recipe": recipe})


def _each(
    crew: Crew, work: Work[Kind], shards: Sequence[Kind], workshop: Workshop, folder: Path, said: str
) -> list[tuple[Kind, S2C2AError]]:
    """Have shards done, each with the files it begins with; what they hand back goes into the folder.

    Returns those that failed: they cost themselves alone.
    """
    failed = []
    given = ((shard, _at_hand(shard, workshop)) for shard in shards)
    doing = f"{len(shards)} {said} to make"
    if shards:
        workshop.progress(doing, 0, len(shards))
    for done, ((shard, _), made) in enumerate(as_done(crew, partial(_tried, work), given), 1):
        if isinstance(made, S2C2AError):
            failed.append((shard, made))
        else:
            unpack(made, folder)
        workshop.progress(doing, done, len(shards))
    return failed


def _tried(work: Work[Kind], given: tuple[Kind, Parcel]) -> Parcel | S2C2AError:
    """On the crew's side, as all below: what the work made, or why it failed."""
    try:
        return work(given)
    except S2C2AError as error:
        return error


def _at_hand(shard: Job | Need, workshop: Workshop) -> Parcel:
    """Files that a shard would make first, were they not there: networks for runs, a recording for networks."""
    need = _need(shard) if isinstance(shard, Job) else replace(shard, kind="recording")
    return packed([workshop.file(need)]) if need and workshop.has(need) else {}


def _file(job: Job, workshop: Workshop) -> Path | None:
    need = _need(job)
    return workshop.file(need) if need else None


def _make(fidelity: str, given: tuple[Need, Parcel]) -> Parcel:
    """Make a file, and whatever it is made from."""
    need, parcel = given
    with TemporaryDirectory() as place:
        workshop = Workshop(unpack(parcel, Path(place)), fidelity, threads=1)
        workshop.make(need)
        return packed(path for path in workshop.folder.iterdir() if path.name not in parcel)


def _run(fidelity: str, given: tuple[Job, Parcel]) -> Parcel:
    """Run, and hand back the files of a shelf."""
    job, parcel = given
    with TemporaryDirectory() as place:
        workshop = Workshop(unpack(parcel, Path(place) / "data"), fidelity, threads=1)
        strategies = workshop_strategies(workshop, job.arm, job.recipe, guard=job.conditions.guard)
        shelf = shelf_for(job.recipe, Path(place) / "runs")
        follow(job.tasks, job.arm, (job.controller,), (job.seed,), strategies, job.recipe, job.conditions, shelf)
        return packed((Path(place) / "runs").iterdir())


def _need(job: Job) -> Need | None:
    return need_of(job.controller, job.arm, job.recipe, job.seed)


def _unfinished(job: Job, folder: Path) -> Job:
    """The same with those tasks alone that are not on the shelf."""
    shelf = shelf_for(job.recipe, folder)

    def is_missing(task: Task) -> bool:
        place = shelf.place_of(job.arm, job.controller, job.seed, task, job.conditions)
        return place is None or load_rollout(place, task) is None

    asked = zip(job.tasks, asked_of(job.tasks, job.arm, job.recipe), strict=True)
    return replace(job, tasks=tuple(task for task, weighed in asked if is_missing(weighed)))
