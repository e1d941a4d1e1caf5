"""`s2c2a sweep`: a better recipe, searched in closed loop."""

from dataclasses import asdict
from importlib.metadata import version
from typing import Annotated

import tyro

from s2c2a.arm import load_arm
from s2c2a.cli.console import (
    Arm,
    FidelityName,
    GuardName,
    RecipeName,
    print_table,
    progress_bar,
)
from s2c2a.cli.execution import (
    ALL_CORES,
    RobotName,
    RobotOptions,
    Work,
    body_for,
    executor_for,
    require,
)
from s2c2a.errors import S2C2AError
from s2c2a.executors import Serial

SHOWN = 10

Tasks = tyro.conf.Positional[
    Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME|FILE ...")]
]
Vary = Annotated[tuple[str, ...], tyro.conf.arg(metavar="PLACE=VALUES ...")]


def sweep(
    tasks: Tasks,
    vary: Vary,
    arm: Arm = "twin_arm",
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
    """Search a better recipe: trials are trained and judged by their error in closed loop.

    Cut short, it goes on where it was; with more --trials, it goes on from there.

    Args:
        tasks: what each trial is judged on, by name or a file of waypoints (.csv); the
            mean counts.
        vary: what to try: planner.solver.iterations=5:60 (a range),
            c2s_fit.learning_rate=1e-4:1e-2:log (by its logarithm), c2s.hidden=32,64,128
            (choices), one after the other. A wrong name is told with those there are.
        arm: a preset or an arm file.
        recipe: to begin from.
        trials: how many in all.
        seeds: of data, training and start in each trial, from zero; their mean counts.
        metric: of the tasks; the first one of the first task if not stated.
        robot: what is driven: the simulated arm, or a class of your own, one trial
            after the other; networks are trained on the simulated arm's recordings.
        robot_option: what that class takes.
        fidelity: of the simulation that is driven.
        payload: mass at the tip [kg].
        guard: what keeps out of obstacles: the tip, or the whole arm.
        seed: of the choices.
        batch: trials that are chosen together, and can run side by side.
        work: where results go, runs/sweep-TASK-ARM if not stated, and who works.
    """
    require("sweep", "optuna")
    from s2c2a import jobs, strategies
    from s2c2a.jobs import sweep as searching
    from s2c2a.jobs.run_folder import open_run_folder
    from s2c2a.jobs.search_space import varied_from
    from s2c2a.tasks import task_named

    spec = load_arm(arm)
    chosen = strategies.recipe_from(recipe)
    numbers = tuple(jobs.checked_seeds(0, seeds))
    if not tasks:
        raise S2C2AError("no task to judge by; name at least one, such as circle")
    asked = tuple(task_named(name, spec) for name in dict.fromkeys(tasks))
    varied = varied_from(vary, chosen)
    judged = metric or asked[0].scores[0].metric
    under = jobs.Conditions(body_for(robot, robot_option, fidelity, payload), guard)
    plan = searching.Sweep(
        spec, asked, chosen, varied, numbers, judged, batch, seed, under
    )
    options: dict = {
        "tasks": tasks,
        "vary": vary,
        "arm": spec.model_dump(mode="json"),
        "recipe": asdict(chosen),
    }
    options |= {
        "seeds": numbers,
        "metric": judged,
        "conditions": asdict(under),
        "seed": seed,
        "batch": batch,
    }
    options["optuna"] = version("optuna")
    workers = (
        executor_for(work.jobs, work.cluster) if under.body.simulated else Serial()
    )
    with workers as executor, progress_bar() as progress:
        label = f"sweep-{asked[0].name}-{spec.name}"
        place = open_run_folder(work.out, label, options, work.overwrite, go_on=True)
        cache = jobs.Cache(runs_in=place / "runs")
        done = searching.search(plan, trials, place, cache, executor, progress)
        best, weights = searching.save_best(done, plan, place, cache, progress)
    table, figure = searching.save_trials(done, plan, place)
    places = [one.place for one in varied]
    rows = []
    for one in done[:SHOWN]:
        tried = (
            f"{one.values[place]:.6g}" if place in one.values else ""
            for place in places
        )
        rows.append(
            (
                str(one.number),
                *tried,
                f"failed: {one.said}" if one.score is None else f"{one.score:.4f}",
            )
        )
    print_table(f"{len(done)} trials, the best first", ("trial", *places, judged), rows)
    print(
        f"best recipe: {best} (as --recipe {best})\nits networks: {weights} (as --weights)"
    )
    print(f"figure: {figure}\nall trials: {table}")
