"""`s2c2a run`: controllers on a task."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from s2c2a.cli.console import Arm, Controller, FidelityName, File, GuardName, RecipeName, print_rows, progress_bar
from s2c2a.cli.crews import crew_for

if TYPE_CHECKING:
    from s2c2a.arm import ArmSpec
    from s2c2a.experiments.following import Run
    from s2c2a.tasks import Task

DEFAULT = "best"


def run(
    task: File,
    arm: Arm = "twin_arm",
    controller: tuple[Controller, ...] = ("s2c2a",),
    recipe: RecipeName | None = None,
    strategy: Path | None = None,
    seed: int = 0,
    seeds: int = 1,
    fidelity: FidelityName = "fast",
    payload: float = 0.0,
    guard: GuardName = "tip",
    out: Path | None = None,
    overwrite: bool = False,
    jobs: int | None = None,
    video: bool = False,
) -> None:
    """Let controllers work on a task, and show what happened: results, figure, replay page.

    Args:
        task: its name (circle, tilt-50, hold-end, reach-2, risk-a, flee, follow, ...), or a file of waypoints
            (columns time, x, y, z and, where wanted, axis_x, axis_y, axis_z, module) ending in .csv.
        arm: a preset or an arm file.
        controller: one or several, compared in one figure.
        recipe: how networks are trained and plans made, `best` if not stated; a strategy file brings its own.
        strategy: a file made by `s2c2a train`; without it, networks are trained, or found in the
            cache (S2C2A_CACHE moves it).
        seed: of data, training and start; the first one of several.
        seeds: how many.
        fidelity: of the simulation that is driven; data come from the fast one.
        payload: mass at the tip [kg].
        guard: what keeps out of obstacles: the tip, or the whole arm.
        out: the run folder; one with the time in its name if not stated.
        overwrite: replace the run folder if it exists.
        jobs: trainings and runs side by side, where there are several seeds and no strategy file; all cores if not
            stated. Same seeds, same scores.
        video: also write a moving picture of the first run: an MP4 where ffmpeg is found, a GIF otherwise.
    """
    from s2c2a.arm import load_arm
    from s2c2a.errors import S2C2AError
    from s2c2a.experiments.ahead import jobs_for, make_all_ahead, shelf_for
    from s2c2a.experiments.following import (
        Conditions,
        Shelf,
        checked_seeds,
        follow,
        score_rows,
        workshop_strategies,
    )
    from s2c2a.experiments.run_folder import draw_runs, open_run_folder, save_results
    from s2c2a.experiments.workshop import Workshop
    from s2c2a.robots.simulation import SimulatedRobot
    from s2c2a.shards import compute_on_one_thread
    from s2c2a.strategies import load_strategy, recipe_from

    compute_on_one_thread()
    spec, numbers = load_arm(arm), checked_seeds(seed, seeds)
    asked = _asked(task, spec)
    SimulatedRobot(spec, fidelity, payload=payload)  # says at once what it cannot be
    saved = load_strategy(strategy, spec) if strategy else None
    if saved and recipe:
        raise S2C2AError(f"{strategy} brings its own recipe ('{saved.recipe.name}'); leave out --recipe {recipe}")
    chosen = saved.recipe if saved else recipe_from(recipe or DEFAULT)
    options: dict = {
        "task": task,
        "arm": spec.model_dump(mode="json"),
        "controller": controller,
        "recipe": asdict(chosen),
    }
    options |= {"seeds": list(numbers), "fidelity": fidelity, "payload": payload, "guard": guard, "strategy": strategy}
    unfinished = out is not None and not (out / f"{spec.name}.html").exists()
    folder = open_run_folder(out, f"{asked.name}-{spec.name}", options, overwrite, go_on=unfinished)
    under, shelf = Conditions(fidelity, payload, guard), Shelf()
    with progress_bar() as progress:
        workshop = Workshop(progress=progress)
        if seeds > 1 and saved is None:
            shelf = shelf_for(chosen, folder / "runs")
            with crew_for(jobs, None) as crew:
                every = jobs_for([asked], spec, controller, numbers, chosen, under)
                make_all_ahead(every, folder / "runs", workshop, crew)
        strategies = workshop_strategies(workshop, spec, chosen, saved, guard)
        runs = follow([asked], spec, controller, numbers, strategies, chosen, under, shelf, progress)
    rows = score_rows("run", spec, runs, chosen.name, fidelity)
    save_results(folder, rows, runs)
    figure, page = draw_runs(folder, spec, runs, chosen.name, fidelity)
    print_rows(f"{asked.name} with {spec.name}", rows)
    for row in rows:
        if row.metric == "position":
            print(f"{row.controller}: {row.mean / spec.length:.1f} % of the arm's length")
    if video:
        _film(runs[0], spec, folder)
    print(f"figure: {figure}\nreplay: {page}\nall of it: {folder}")


def _asked(task: str, spec: "ArmSpec") -> "Task":
    """The task, and a word on every waypoint of a file that the arm cannot reach."""
    from s2c2a.tasks import load_waypoints, out_of_reach, task_named

    asked = task_named(task, spec)
    for far in out_of_reach(load_waypoints(task), spec) if task.endswith(".csv") else ():
        print(f"out of reach by {100 * far.gap:.1f} cm: waypoint at {far.time:g} s, module {far.module}")
    return asked


def _film(run: "Run", spec: "ArmSpec", folder: Path) -> None:
    from s2c2a.experiments.run_folder import trace_of
    from s2c2a.viz.video import save_video

    print(f"video: {save_video(trace_of(run), spec, folder / spec.name)}")
