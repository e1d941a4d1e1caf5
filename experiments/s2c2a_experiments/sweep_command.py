"""Command `s2c2a sweep`: search for a better recipe in closed loop."""

from dataclasses import asdict
from importlib.metadata import version
from typing import TYPE_CHECKING, Annotated

import tyro

from s2c2a.arm import load_arm
from s2c2a.cli.console import (
    Arm,
    FidelityName,
    GuardName,
    RecipeName,
    StrategyName,
    print_table,
    progress_bar,
)
from s2c2a.cli.emergency import emergency_controls
from s2c2a.cli.execution import (
    ALL_CORES,
    RobotName,
    RobotOptions,
    Work,
    check_parallel,
    make_executor,
    require,
    robot_factory_for,
)
from s2c2a.errors import S2C2AError
from s2c2a.execution.executors import Serial

if TYPE_CHECKING:
    from s2c2a_experiments.sweep import Sweep, Trial

MAX_ROWS = 10  # of the printed table; the file has all

Tasks = tyro.conf.Positional[
    Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME|FILE ...")]
]
Vary = Annotated[tuple[str, ...], tyro.conf.arg(metavar="KEY=VALUES ...")]


def sweep(
    tasks: Tasks,
    vary: Vary,
    arm: Arm = "twin_arm",
    strategy: StrategyName = "s2c2a",
    recipe: RecipeName = "best",
    trials: int = 32,
    seeds: int = 1,
    metric: str | None = None,
    robot: RobotName = "sim",
    robot_option: RobotOptions = (),
    fidelity: FidelityName = "fast",
    payload: float = 0.0,
    guard: GuardName = "tip",
    seed: int = 0,
    batch: int = 8,
    work: Work = ALL_CORES,
) -> None:
    """Search for a better recipe: train trials, and compare their errors in closed loop.

    An interrupted sweep continues in its run directory; a larger --trials adds trials.

    Args:
        tasks: that each trial is scored on, by name or a file of waypoints (.csv); their
            mean counts.
        vary: recipe keys and their values: planner.solver.iterations=5:60 (a range),
            c2s_fit.learning_rate=1e-4:1e-2:log (a logarithmic range),
            c2s.hidden=32,64,128 (choices); options of the strategy: strategy.gain=0.1:1. A
            wrong key is answered with the valid ones.
        arm: a preset or an arm file.
        strategy: by name, or your own file.py:Class.
        recipe: to start from.
        trials: number of trials in all.
        seeds: of data, training and start in each trial, from zero; their mean counts.
        metric: of the tasks; by default the first one of the first task.
        robot: the simulated arm, or your own class, one trial after another; networks are
            trained on recordings of the simulated arm.
        robot_option: parameters of that class.
        fidelity: of the simulation that is driven.
        payload: mass at the tip [kg].
        guard: keep the tip, or the whole arm, out of obstacles.
        seed: of the choices.
        batch: trials that are chosen together and can run in parallel.
        work: run directory (runs/sweep-TASK-ARM by default) and parallel execution.
    """
    require("sweep", "optuna")
    from s2c2a import jobs, strategies
    from s2c2a.jobs.run_folder import open_run_directory
    from s2c2a.tasks import load_task
    from s2c2a_experiments import sweep as sweeps
    from s2c2a_experiments.search_space import varied_from, with_options

    spec = load_arm(arm)
    start = strategies.recipe_from(recipe)
    if not tasks:
        raise S2C2AError("no task to score; name at least one, such as circle")
    chosen_tasks = tuple(load_task(name, spec) for name in dict.fromkeys(tasks))
    factory = robot_factory_for(robot, robot_option, fidelity, payload)
    check_parallel(factory, work.jobs, work.cluster)
    plan = sweeps.Sweep(
        arm=spec,
        tasks=chosen_tasks,
        recipe=start,
        varied=varied_from(vary, start, strategy),
        seeds=tuple(jobs.checked_seeds(0, seeds)),
        metric=metric or chosen_tasks[0].scores[0].metric,
        batch=batch,
        seed=seed,
        conditions=jobs.Conditions(factory, strategies.RunOptions(guard)),
        strategy=strategy,
    )
    options = {
        "tasks": tasks,
        "vary": vary,
        "arm": spec.model_dump(mode="json"),
        "strategy": strategy,
        "recipe": asdict(start),
        "seeds": plan.seeds,
        "metric": plan.metric,
        "conditions": asdict(plan.conditions),
        # keys of the first trial: they change with waypoint files and custom code
        "runs": [job.file for job in plan.jobs()],
        "seed": seed,
        "batch": batch,
        "optuna": version("optuna"),
    }
    executor = make_executor(work.jobs, work.cluster) if factory.simulated else Serial()
    label = f"sweep-{chosen_tasks[0].name}-{spec.name}"
    with emergency_controls(factory), executor, progress_bar() as progress:
        directory = open_run_directory(
            work.out, label, options, work.overwrite, resume=True
        )
        cache = jobs.Cache(runs_in=directory / "runs")
        done = sweeps.search(plan, trials, directory, cache, executor, progress)
        best, weights = sweeps.save_best(done, plan, directory, cache, progress)
    table, figure = sweeps.save_trials(done, plan, directory)
    _print_trials(done, plan)
    best_strategy = with_options(strategy, done[0].values)
    if best_strategy != strategy:
        print(f"best options: --strategy {best_strategy}")
    print(f"best recipe: {best} (use it with --recipe {best})")
    if weights is not None:
        print(f"its networks: {weights} (use them with --weights)")
    print(f"figure: {figure}\nall trials: {table}")


def _print_trials(trials: "list[Trial]", plan: "Sweep") -> None:
    """Print the best trials."""
    keys = [varied.place for varied in plan.varied]
    rows = []
    for trial in trials[:MAX_ROWS]:
        values = [
            f"{trial.values[key]:.6g}" if key in trial.values else "" for key in keys
        ]
        failed = f"failed: {trial.failure}"
        score = failed if trial.score is None else f"{trial.score:.4f}"
        rows.append((str(trial.number), *values, score))
    title = f"{len(trials)} trials, best first"
    print_table(title, ("trial", *keys, plan.metric), rows)
