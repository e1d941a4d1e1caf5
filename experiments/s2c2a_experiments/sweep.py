"""Search for a better recipe: trials scored in closed loop (extra `sweep`).

Trials are sampled in batches and reported to the sampler in order, and each trial has
its own random stream: the same options give the same trials on any executor and after
any interruption.
"""

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
import optuna
from optuna.storages import JournalStorage, journal
from optuna.trial import FrozenTrial, TrialState

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError, did_you_mean
from s2c2a.evaluation import METRICS
from s2c2a.evaluation.report import save_csv
from s2c2a.execution.progress import Progress, quiet
from s2c2a.files.text import list_in_manifest
from s2c2a.jobs.artifacts import Cache
from s2c2a.jobs.execution import Make, in_groups, made, try_all
from s2c2a.jobs.job import SIMULATED_FAST, Conditions, Job, Run, jobs_for
from s2c2a.strategies import Recipe, save_networks, save_recipe, strategy_named
from s2c2a.tasks import Task
from s2c2a_experiments.figures.trials import trials_figure
from s2c2a_experiments.search_space import (
    STRATEGY,
    Value,
    Varied,
    value_at,
    with_options,
    with_values,
)

TRIALS = "trials.log"


@dataclass(frozen=True)
class Sweep:
    """The search space and the objective of a sweep.

    Attributes:
        arm: the arm to simulate.
        tasks: of each trial.
        recipe: the starting point; the first trial, if it lies in the search space.
        varied: the search space.
        seeds: of data, training and start; a trial's score is the mean over seeds and
            tasks.
        metric: of the tasks.
        batch: trials sampled together, which can run in parallel but do not learn from
            each other.
        seed: of the sampler.
        conditions: robot and options of the runs.
        strategy: that is trained and run.
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
    strategy: str = "s2c2a"

    def __post_init__(self):
        """Validate the metric, the search space and the numbers."""
        self._check_varied()
        metrics = [{score.metric for score in task.scores} for task in self.tasks]
        common = set.intersection(*metrics)
        if self.metric not in common:
            raise S2C2AError(
                f"no metric '{self.metric}' in all these tasks"
                f"{did_you_mean(self.metric, common)}; "
                f"they share {', '.join(sorted(common))}"
            )
        if self.batch < 1 or self.seed < 0:
            raise S2C2AError(
                f"batch {self.batch}, seed {self.seed}: give a batch of at least one "
                "trial and a seed of at least zero"
            )

    def _check_varied(self) -> None:
        """Refuse places that the strategy does not read: all trials would be equal."""
        keys = strategy_named(self.strategy).recipe_keys
        for varied in self.varied:
            if varied.place.startswith(STRATEGY):
                continue
            if varied.place.partition(".")[0] not in keys:
                used = ", ".join(sorted(keys - {"name"})) or "no key of a recipe"
                raise S2C2AError(
                    f"--vary {varied.place} would have no effect: strategy "
                    f"'{self.strategy}' uses {used}; vary what it uses, or choose "
                    "another --strategy"
                )

    def jobs(self, values: dict[str, Value] | None = None) -> list[Job]:
        """The runs of a trial with these values, or of the starting point.

        Raises:
            S2C2AError: the values are invalid together.
        """
        values = values or {}
        recipe = with_values(self.recipe, values)
        strategies = (with_options(self.strategy, values),)
        return jobs_for(
            self.tasks, self.arm, strategies, self.seeds, recipe, self.conditions
        )

    @property
    def direction(self) -> Literal["minimize", "maximize"]:
        """Whether a good metric is small or large."""
        return "maximize" if METRICS[self.metric].rises else "minimize"


@dataclass(frozen=True)
class Trial:
    """One trial and its score.

    Attributes:
        number: from zero.
        values: place -> value.
        score: of the metric; None if the trial failed.
        failure: why it failed; empty if it did not.
    """

    number: int
    values: dict[str, Value]
    score: float | None
    failure: str = ""


def search(
    sweep: Sweep,
    trials: int,
    folder: Path,
    cache: Cache,
    executor: Executor | None = None,
    progress: Progress = quiet,
) -> list[Trial]:
    """Run a search, or resume one, until it has a number of trials.

    Args:
        sweep: search space and objective.
        trials: total number, with those of earlier calls.
        folder: keeps the trials.
        cache: where recordings, networks and runs are kept.
        executor: trains and runs; this process if None.
        progress: called with a label, the number done and the total.

    Returns:
        All trials, the best first, failed ones last.

    Raises:
        S2C2AError: `trials` is below one, or the executor failed; finished results are
            kept.
    """
    if trials < 1:
        raise S2C2AError(f"{trials} trials; give at least one")
    study = _open_study(sweep, folder)
    for batch in _batches(study, sweep, trials):
        label = f"trials {batch[0].number} to {batch[-1].number}"

        def report(doing: str, done: int, total: int, label: str = label) -> None:
            progress(f"{label}: {doing}", done, total)

        def make(artifacts, report=report):
            return try_all(artifacts, cache, executor, report)

        for trial in _run_trials(batch, sweep, make):
            _save_trial(study, trial)
    return _ranked(study, sweep)


def best_of(trials: Sequence[Trial]) -> Trial:
    """The best trial of those that `search` returned.

    Raises:
        S2C2AError: every trial failed.
    """
    best = trials[0]
    if best.score is None:
        raise S2C2AError(
            f"all {len(trials)} trials failed, the first because: {best.failure}; "
            "vary less"
        )
    return best


def save_best(
    trials: Sequence[Trial],
    sweep: Sweep,
    folder: Path,
    cache: Cache,
    progress: Progress,
) -> tuple[Path, Path | None]:
    """Write the best trial's recipe, and its strategy's networks of the first seed.

    Args:
        trials: the best first.
        sweep: search space and objective.
        folder: for both files.
        cache: has the networks.
        progress: called with a label, the number done and the total.

    Returns:
        Both files; no weights of a strategy without training.

    Raises:
        S2C2AError: every trial failed.
    """
    values = best_of(trials).values
    name = f"{sweep.recipe.name}-swept"
    best = with_values(sweep.recipe, values)
    recipe = save_recipe(best, folder / f"{name}.toml")
    needed = sweep.jobs(values)[0].needs
    if not needed:
        return recipe, None
    networks = made(needed[0], cache, progress)
    renamed = replace(networks, recipe=replace(networks.recipe, name=name))
    weights = folder / "best.safetensors"
    save_networks(renamed, weights)
    return recipe, weights


def _open_study(sweep: Sweep, folder: Path) -> optuna.Study:
    """The study in the directory; the first trial of a new one is the recipe itself."""
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    folder.mkdir(parents=True, exist_ok=True)
    # Optuna writes the journal and its lock itself
    for name in (TRIALS, f"{TRIALS}.lock"):
        list_in_manifest(folder / name)
    storage = JournalStorage(journal.JournalFileBackend(str(folder / TRIALS)))
    study = optuna.create_study(
        storage=storage,
        study_name="sweep",
        direction=sweep.direction,
        load_if_exists=True,
    )
    if not study.trials:
        start = {
            item.place: value_at(sweep.recipe, item.place, sweep.strategy)
            for item in sweep.varied
        }
        if all(item.holds(start[item.place]) for item in sweep.varied):
            study.enqueue_trial(start)
    return study


def _batches(
    study: optuna.Study, sweep: Sweep, trials: int
) -> Iterator[list[FrozenTrial]]:
    """Trials to run; those of an interrupted batch come first."""
    distributions = {item.place: _distribution(item) for item in sweep.varied}
    count = sum(trial.state != TrialState.WAITING for trial in study.trials)
    first_end = -(-count // sweep.batch) * sweep.batch
    for end in (*range(first_end, trials, sweep.batch), trials):
        for number in range(count, end):
            stream = np.random.SeedSequence([sweep.seed, number]).generate_state(1)
            study.sampler = optuna.samplers.TPESampler(
                seed=int(stream[0]), constant_liar=True
            )
            study.ask(distributions)
        for trial in study.get_trials(states=(TrialState.RUNNING,)):
            if set(trial.params) != set(distributions):
                failure = "killed while its values were chosen"
                _save_trial(study, Trial(trial.number, {}, None, failure))
        batch = study.get_trials(states=(TrialState.RUNNING,))
        if batch:
            yield batch
        count = end


def _distribution(item: Varied) -> optuna.distributions.BaseDistribution:
    if not item.is_range:
        return optuna.distributions.CategoricalDistribution(item.choices)
    low, high = item.choices
    if isinstance(low, int):
        return optuna.distributions.IntDistribution(low, int(high), log=item.log)
    return optuna.distributions.FloatDistribution(low, high, log=item.log)


def _run_trials(
    batch: Sequence[FrozenTrial], sweep: Sweep, make: Make
) -> Iterator[Trial]:
    """Run all trials of a batch together, then score each."""
    groups: list[list[Job]] = []
    failures: dict[int, S2C2AError] = {}
    for trial in batch:
        try:
            groups.append(sweep.jobs(trial.params))
        except S2C2AError as error:  # values that are valid alone but not together
            failures[trial.number] = error
    results = iter(in_groups(make, groups))
    for trial in batch:
        failure = failures.get(trial.number)
        runs = [failure] if failure else next(results)
        yield _scored(sweep, trial, runs)


def _scored(
    sweep: Sweep, trial: FrozenTrial, results: Sequence[Run | S2C2AError]
) -> Trial:
    """The trial with its mean score over runs, tasks and seeds, or with its failure."""
    values = []
    for result in results:
        if isinstance(result, S2C2AError):
            return Trial(trial.number, trial.params, None, str(result))
        for scored in result.scores:
            if scored.score.metric == sweep.metric:
                values.append(scored.value)
    score = float(np.mean(values))
    if not np.isfinite(score):
        failure = f"no step counts for {sweep.metric}"
        return Trial(trial.number, trial.params, None, failure)
    return Trial(trial.number, trial.params, score, failure="")


def _save_trial(study: optuna.Study, trial: Trial) -> None:
    if trial.score is None:
        study.set_user_attr(str(trial.number), trial.failure)
        study.tell(trial.number, None, TrialState.FAIL)
    else:
        study.tell(trial.number, trial.score)


def _ranked(study: optuna.Study, sweep: Sweep) -> list[Trial]:
    failures = study.user_attrs
    trials = []
    for done in study.get_trials(states=(TrialState.COMPLETE, TrialState.FAIL)):
        failure = failures.get(str(done.number), "")
        trials.append(Trial(done.number, dict(done.params), done.value, failure))
    sign = -1.0 if sweep.direction == "maximize" else 1.0

    def rank(trial: Trial) -> tuple[bool, float, int]:
        return (trial.score is None, sign * (trial.score or 0.0), trial.number)

    return sorted(trials, key=rank)


def save_trials(
    trials: Sequence[Trial], sweep: Sweep, folder: Path
) -> tuple[Path, Path]:
    """Write every trial as comma-separated values, and draw them.

    Args:
        trials: in any order.
        sweep: search space and objective.
        folder: for both files.

    Returns:
        Both files.
    """
    places = [item.place for item in sweep.varied]
    metric = METRICS[sweep.metric]
    in_order = sorted(trials, key=lambda trial: trial.number)
    rows = []
    for trial in in_order:
        score = "" if trial.score is None else f"{trial.score:.6g}"
        values = [trial.values.get(place, "") for place in places]
        rows.append((trial.number, score, *values, trial.failure))
    table = folder / "trials.csv"
    save_csv(("trial", sweep.metric, *places, "failed because"), rows, table)
    done = [trial for trial in in_order if trial.score is not None]
    figure = trials_figure(
        [trial.number for trial in done],
        np.array([trial.score for trial in done], dtype=float),
        {
            place: np.array([trial.values[place] for trial in done], dtype=float)
            for place in places
        },
        f"{sweep.metric} [{metric.unit}]",
        {item.place for item in sweep.varied if item.log},
        folder / "trials.png",
        metric.rises,
    )
    return table, figure
