"""`s2c2a sweep`: a better recipe, searched in closed loop."""

from pathlib import Path
from typing import Annotated

import tyro

from s2c2a.cli.console import Arm, FidelityName, GuardName, RecipeName, print_table, progress_bar
from s2c2a.cli.crews import Address, crew_for, require

SHOWN = 10

Tasks = tyro.conf.Positional[Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME|FILE ...")]]
Vary = Annotated[tuple[str, ...], tyro.conf.arg(metavar="PLACE=VALUES ...")]


def sweep(
    tasks: Tasks,
    vary: Vary,
    arm: Arm = "twin_arm",
    recipe: RecipeName = "best",
    trials: int = 32,
    seeds: int = 1,
    metric: str | None = None,
    fidelity: FidelityName = "fast",
    payload: float = 0.0,
    guard: GuardName = "tip",
    seed: int = 0,
    batch: int = 8,
    out: Path | None = None,
    overwrite: bool = False,
    jobs: int | None = None,
    cluster: Address = None,
) -> None:
    """Search a better recipe: trials are trained and judged by their error in closed loop.

    Cut short, it goes on where it was; with more --trials, it goes on from there.

    Args:
        tasks: what each trial is judged on, by name or a file of waypoints (.csv); the mean counts.
        vary: what to try: planner.iterations=5:60 (a range), c2s_fit.learning_rate=1e-4:1e-2:log (by its logarithm),
            c2s.hidden=32,64,128 (choices), one after the other. A wrong name is told with those there are.
        arm: a preset or an arm file.
        recipe: to begin from.
        trials: how many in all.
        seeds: of data, training and start in each trial, from zero; their mean counts.
        metric: of the tasks; the first one of the first task if not stated.
        fidelity: of the simulation that is driven.
        payload: mass at the tip [kg].
        guard: what keeps out of obstacles: the tip, or the whole arm.
        seed: of the choices.
        batch: trials that are chosen together, and can run side by side.
        out: the run folder; runs/sweep-TASK-ARM if not stated.
        overwrite: begin anew.
        jobs: trainings and runs side by side; all cores if not stated. Same seeds, same trials.
        cluster: let its workers train and run. Same seeds, same trials.
    """
    require("sweep", "optuna")
    from dataclasses import asdict, replace
    from importlib.metadata import version

    from s2c2a.arm import load_arm
    from s2c2a.errors import S2C2AError
    from s2c2a.experiments.following import Conditions, checked_seeds
    from s2c2a.experiments.run_folder import open_run_folder
    from s2c2a.experiments.sweep import Sweep, best_recipe, save_trials, search
    from s2c2a.experiments.varying import varied_from
    from s2c2a.experiments.workshop import Workshop
    from s2c2a.strategies import recipe_from, save_recipe, save_strategy
    from s2c2a.tasks import task_named

    spec, chosen, numbers = load_arm(arm), recipe_from(recipe), checked_seeds(0, seeds)
    if not tasks:
        raise S2C2AError("no task to judge by; name at least one, such as circle")
    asked = tuple(task_named(name, spec) for name in dict.fromkeys(tasks))
    varied = varied_from(vary, chosen)
    what = metric or asked[0].scores[0].metric
    under = Conditions(fidelity, payload, guard)
    plan = Sweep(spec, asked, chosen, varied, tuple(numbers), what, batch, seed, under)
    options = {
        "tasks": tasks,
        "vary": vary,
        "arm": spec.model_dump(mode="json"),
        "recipe": asdict(chosen),
        "seeds": seeds,
        "metric": what,
        "conditions": asdict(under),
        "seed": seed,
        "batch": batch,
        "optuna": version("optuna"),
    }
    folder = out or Path("runs") / f"sweep-{asked[0].name}-{spec.name}"
    folder = open_run_folder(folder, "sweep", options, overwrite, go_on=True)
    with crew_for(jobs, cluster) as crew, progress_bar() as progress:
        workshop = Workshop(progress=progress)
        done = search(plan, trials, folder, workshop, crew)
        best = best_recipe(plan, done)
        name = f"{chosen.name}-swept"
        save_strategy(
            replace(workshop.networks(spec, best, numbers[0]), recipe=replace(best, name=name)),
            folder / "best.safetensors",
        )
    table, figure = save_trials(done, plan, folder)
    header = ("trial", *(one.place for one in varied), what)
    print_table(f"{len(done)} trials, the best first", header, [_cells(one, header[1:-1]) for one in done[:SHOWN]])
    written = save_recipe(best, folder / f"{name}.toml")
    print(
        f"best recipe: {written} (as --recipe {written})\nits networks: {folder / 'best.safetensors'} (as --strategy)"
    )
    print(f"figure: {figure}\nall trials: {table}")


def _cells(trial, places) -> tuple[str, ...]:
    score = f"failed: {trial.said}" if trial.score is None else f"{trial.score:.4f}"
    return (
        str(trial.number),
        *(f"{trial.values[place]:.6g}" if place in trial.values else "" for place in places),
        score,
    )
