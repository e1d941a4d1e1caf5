"""A search for a better recipe: trials of some of its numbers, judged in closed loop (extra `sweep`).

Trials are chosen a batch at a time and told to the search in their order, and each
choice has a random stream of its own: the same options give the same trials on any
executor, and after any kill.
"""

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np
import optuna
from optuna.storages import JournalStorage, journal
from optuna.trial import FrozenTrial, TrialState

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError
from s2c2a.evaluation import METRICS
from s2c2a.evaluation.report import save_csv
from s2c2a.jobs.artifacts import Cache, NetworksArtifact
from s2c2a.jobs.job import SIMULATED_FAST, Conditions, Job, Run, jobs_for
from s2c2a.jobs.execution import Make, in_groups, made, try_all
from s2c2a.jobs.search_space import Value, Varied, value_at, with_values
from s2c2a.progress import Progress, quiet
from s2c2a.strategies import Recipe, save_recipe, save_strategy
from s2c2a.tasks import Task
from s2c2a.viz import trials_figure

TRIALS = "trials.log"


@dataclass(frozen=True)
class Sweep:
    """What is searched, and by what it is judged.

    Attributes:
        arm: the arm to simulate.
        tasks: what each trial is judged on.
        recipe: to begin from; the first trial, if it lies within what is varied.
        varied: what is tried.
        seeds: of data, training and start; a trial's value is the mean over them and
            over the tasks.
        metric: of the tasks.
        batch: trials chosen together: so many can run side by side, and learn nothing
            from each other.
        seed: of the choices.
        conditions: robot and guard.
    """

    arm: ArmSpec
    tasks: tuple[Task, ...]
    recipe: Recipe
    varied: tuple[Varied, ...]
    seeds: tuple[int, ...] = (0,)
    metric: str = "position"
    batch: int = 8
    seed: int = 0
    conditions: Conditions = SIMULATED_FAST

    def __post_init__(self):
        """Refuse what cannot be judged."""
        common = set.intersection(
            *({score.metric for score in task.scores} for task in self.tasks)
        )
        if self.metric not in common:
            raise S2C2AError(
                f"no metric '{self.metric}' in all these tasks; they share {', '.join(sorted(common))}"
            )
        if self.batch < 1 or self.seed < 0:
            raise S2C2AError(
                f"batch {self.batch}, seed {self.seed}: at least one trial, and no negative seed"
            )

    @property
    def direction(self) -> Literal["minimize", "maximize"]:
        """Whether the metric shall fall or rise."""
        return "maximize" if METRICS[self.metric].rises else "minimize"


@dataclass(frozen=True)
class Trial:
    """What was tried and what came of it.

    Attributes:
        number: from zero.
        values: place -> value.
        score: of the metric, or None where the trial failed.
        said: why it failed.
    """

    number: int
    values: dict[str, Value]
    score: float | None
    said: str = ""


def search(
    sweep: Sweep,
    trials: int,
    folder: Path,
    cache: Cache,
    executor: Executor | None = None,
    progress: Progress = quiet,
) -> list[Trial]:
    """Search, or go on with a search, until there are so many trials.

    Args:
        sweep: what to search.
        trials: how many in all, with those that are there.
        folder: of the trials.
        cache: where recordings, networks and runs are kept.
        executor: who trains and runs; this process if None.
        progress: told of it.

    Returns:
        All trials, the best first, failed ones last.

    Raises:
        S2C2AError: no trial is asked for, or the executor failed; what was whole is
            kept.
    """
    if trials < 1:
        raise S2C2AError(f"{trials} trials asked for; take at least one")
    study = _opened(sweep, folder)
    for batch in _batches(study, sweep, trials):
        prefixed = partial(
            _told, progress, f"trials {batch[0].number} to {batch[-1].number}"
        )
        make = partial(try_all, cache=cache, executor=executor, progress=prefixed)
        for number, score, said in _judged(batch, sweep, make):
            _tell(study, number, score, said)
    return _ranked(study, sweep)


def best_recipe(sweep: Sweep, trials: Sequence[Trial]) -> Recipe:
    """The recipe of the best trial.

    Raises:
        S2C2AError: every trial failed.
    """
    if trials[0].score is None:
        raise S2C2AError(
            f"all {len(trials)} trials failed, the first because: {trials[0].said}; vary less"
        )
    return with_values(sweep.recipe, trials[0].values)


def save_best(
    trials: Sequence[Trial], sweep: Sweep, folder: Path, cache: Cache, told: Progress
) -> tuple[Path, Path]:
    """Write the best trial's recipe, and its networks, trained with the first seed; returns both files.

    Raises:
        S2C2AError: every trial failed.
    """
    best = best_recipe(sweep, trials)
    name = f"{sweep.recipe.name}-swept"
    networks = made(NetworksArtifact(sweep.arm, best, sweep.seeds[0]), cache, told)
    weights = folder / "best.safetensors"
    save_strategy(replace(networks, recipe=replace(best, name=name)), weights)
    return save_recipe(best, folder / f"{name}.toml"), weights


def _opened(sweep: Sweep, folder: Path) -> optuna.Study:
    """The study in the folder; a new one begins with the recipe itself."""
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    folder.mkdir(parents=True, exist_ok=True)
    storage = JournalStorage(journal.JournalFileBackend(str(folder / TRIALS)))
    study = optuna.create_study(
        storage=storage,
        study_name="sweep",
        direction=sweep.direction,
        load_if_exists=True,
    )
    begun = {one.place: value_at(sweep.recipe, one.place) for one in sweep.varied}
    if not study.trials and all(one.holds(begun[one.place]) for one in sweep.varied):
        study.enqueue_trial(begun)
    return study


def _batches(
    study: optuna.Study, sweep: Sweep, trials: int
) -> Iterator[list[FrozenTrial]]:
    """Trials to be judged, chosen when their batch begins; those of a batch that was cut short come first."""
    distributions = {one.place: _distribution(one) for one in sweep.varied}
    begun = len([one for one in study.trials if one.state != TrialState.WAITING])
    for end in (
        *range(-(-begun // sweep.batch) * sweep.batch, trials, sweep.batch),
        trials,
    ):
        for number in range(begun, end):
            stream = np.random.SeedSequence([sweep.seed, number]).generate_state(1)
            study.sampler = optuna.samplers.TPESampler(
                seed=int(stream[0]), constant_liar=True
            )
            study.ask(distributions)
        for one in study.get_trials(states=(TrialState.RUNNING,)):
            if set(one.params) != set(distributions):
                _tell(study, one.number, None, "killed while its values were chosen")
        if chosen := study.get_trials(states=(TrialState.RUNNING,)):
            yield chosen
        begun = end


def _distribution(one: Varied) -> optuna.distributions.BaseDistribution:
    if not one.is_range:
        return optuna.distributions.CategoricalDistribution(one.choices)
    low, high = one.choices
    if isinstance(low, int):
        return optuna.distributions.IntDistribution(low, int(high), log=one.log)
    return optuna.distributions.FloatDistribution(low, high, log=one.log)


def _told(progress: Progress, said: str, doing: str, done: int, total: int) -> None:
    progress(f"{said}: {doing}", done, total)


def _judged(
    batch: Sequence[FrozenTrial], sweep: Sweep, make: Make
) -> Iterator[tuple[int, float | None, str]]:
    """Number and score of every trial, or why there is none; all have been run when the first is told."""
    asked = {one.number: _asked(sweep, one) for one in batch}
    runs = iter(
        in_groups(make, [every for every in asked.values() if isinstance(every, list)])
    )
    for number, every in asked.items():
        yield number, *_score(sweep, next(runs) if isinstance(every, list) else [every])


def _asked(sweep: Sweep, one: FrozenTrial) -> list[Job] | S2C2AError:
    try:
        recipe = with_values(sweep.recipe, one.params)
    except S2C2AError as error:  # values that are sound alone and not together
        return error
    return jobs_for(
        sweep.tasks, sweep.arm, ("s2c2a",), sweep.seeds, recipe, sweep.conditions
    )


def _score(sweep: Sweep, made: Sequence[Run | S2C2AError]) -> tuple[float | None, str]:
    """Mean over runs, tasks and seeds, or why there is none."""
    if error := next((one for one in made if isinstance(one, S2C2AError)), None):
        return None, str(error)
    scores = [one for run in made if isinstance(run, Run) for one in run.scores]
    score = float(
        np.mean([one.value for one in scores if one.score.metric == sweep.metric])
    )
    return (
        (score, "")
        if np.isfinite(score)
        else (None, f"no step counts for {sweep.metric}")
    )


def _tell(study: optuna.Study, number: int, score: float | None, said: str) -> None:
    if score is None:
        study.set_user_attr(str(number), said)
    study.tell(number, score, TrialState.FAIL if score is None else None)


def _ranked(study: optuna.Study, sweep: Sweep) -> list[Trial]:
    done = study.get_trials(states=(TrialState.COMPLETE, TrialState.FAIL))
    said = study.user_attrs
    every = [
        Trial(one.number, dict(one.params), one.value, said.get(str(one.number), ""))
        for one in done
    ]
    sign = -1.0 if sweep.direction == "maximize" else 1.0
    return sorted(
        every,
        key=lambda one: (one.score is None, sign * (one.score or 0.0), one.number),
    )


def save_trials(
    trials: Sequence[Trial], sweep: Sweep, folder: Path
) -> tuple[Path, Path]:
    """Write every trial as comma-separated values, and draw them; returns both files."""
    places = [one.place for one in sweep.varied]
    rows = []
    table = folder / "trials.csv"
    in_order = sorted(trials, key=lambda one: one.number)
    for one in in_order:
        score = "" if one.score is None else f"{one.score:.6g}"
        rows.append(
            (
                one.number,
                score,
                *(one.values.get(place, "") for place in places),
                one.said,
            )
        )
    save_csv(("trial", sweep.metric, *places, "failed because"), rows, table)
    done = [one for one in in_order if one.score is not None]
    numbers = [one.number for one in done]
    scores = np.array([one.score for one in done], dtype=float)
    values = {
        place: np.array([one.values[place] for one in done], dtype=float)
        for place in places
    }
    label = f"{sweep.metric} [{METRICS[sweep.metric].unit}]"
    logarithmic = {one.place for one in sweep.varied if one.log}
    rises = METRICS[sweep.metric].rises
    return table, trials_figure(
        numbers, scores, values, label, logarithmic, folder / "trials.png", rises
    )
