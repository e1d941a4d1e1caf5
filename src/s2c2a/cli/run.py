"""`s2c2a run`: strategies on a task."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from s2c2a.cli.console import (
    Arm,
    FidelityName,
    File,
    GuardName,
    ModelName,
    OptionalRecipe,
    StrategyName,
    print_results,
)
from s2c2a.cli.execution import (
    ALL_CORES,
    RobotName,
    RobotOptions,
    Work,
    body_for,
    making,
)

if TYPE_CHECKING:
    from s2c2a import arm, jobs, robots, tasks


def run(
    task: File,
    arm: Arm = "twin_arm",
    strategy: tuple[StrategyName, ...] = ("s2c2a",),
    recipe: OptionalRecipe = None,
    weights: Path | None = None,
    model: ModelName = None,
    pace: float = 1.0,
    seed: int = 0,
    seeds: int = 1,
    robot: RobotName = "sim",
    robot_option: RobotOptions = (),
    fidelity: FidelityName = "fast",
    payload: float = 0.0,
    told: float = 0.0,
    estimates: bool = True,
    yields: float | None = None,
    guard: GuardName = "tip",
    video: bool = False,
    work: Work = ALL_CORES,
) -> None:
    """Let strategies work on a task, and show what happened: results, figure, replay page.

    Cut short, it goes on where it was, if the folder is named.

    Args:
        task: its name (circle, tilt-50, hold-end, reach-2, risk-a, flee, follow, ...),
            a file of waypoints (columns time, x, y, z and, where desired, axis_x,
            axis_y, axis_z, module) ending in .csv, or your own as file.py:function,
            which is given the arm.
        arm: a preset or an arm file.
        strategy: one or several, compared in one figure.
        recipe: how networks are trained and plans made, `best` if not stated. A file of
            weights brings its own; one beside it must train alike, and says how to
            plan.
        weights: a file made by `s2c2a train`; without it, networks are trained, or
            found in the cache (S2C2A_CACHE moves it).
        model: the class of a forward model of your own that this file names; no code is
            run because a file says so.
        pace: of the task: at 0.5 it takes twice its time, for an arm that may not go as
            far in a control step.
        seed: of data, training and start; the first one of several.
        seeds: how many; several are run side by side.
        robot: what is driven: the simulated arm, or a class of your own such as
            my_arm.py:MyArm.
        robot_option: what that class takes beside the arm.
        fidelity: of the simulation that is driven; data come from the fast one.
        payload: mass that hangs at the tip of the simulated arm [kg].
        told: mass that the strategy is told hangs there [kg]; recipes that observe
            count on it.
        estimates: whether these find loads and leans from what is sensed beside
            encoders (docs/sensors.md).
        yields: force at the tip that is made up for at most where something leans on
            the arm [N]; beyond, it gives way.
        guard: what keeps out of obstacles: the tip, or the whole arm.
        video: also write a moving picture of the first run: an MP4 where ffmpeg is
            found, a GIF otherwise.
        work: where results go, and who works.
    """
    from s2c2a import evaluation, jobs, strategies
    from s2c2a.arm import load_arm
    from s2c2a.jobs.run_folder import draw_runs, save_results
    from s2c2a.models.registry import model_named

    spec = load_arm(arm)
    numbers = jobs.checked_seeds(seed, seeds)
    body = body_for(robot, robot_option, fidelity, payload)
    watched = strategies.Watched(told, estimates, yields)
    under = jobs.Conditions(body, guard, watched)
    if model:
        model_named(model)
    given = (
        jobs.GivenNetworks.read(
            weights, spec, strategies.recipe_from(recipe) if recipe else None
        )
        if weights
        else None
    )
    _check_trained(under.body, strategy, given)
    asked = _asked(task, spec, pace)
    chosen = given.recipe if given else strategies.recipe_from(recipe or "best")
    asked_for = jobs.jobs_for([asked], spec, strategy, numbers, chosen, under, given)
    jobs.check_robots(asked_for)
    options: dict = {
        "task": task,
        "arm": spec.model_dump(mode="json"),
        "strategy": strategy,
        "recipe": asdict(chosen),
    }
    options |= {
        "pace": pace,
        "seeds": list(numbers),
        "conditions": asdict(under),
        "weights": weights,
    }
    alone = not under.body.simulated or (seeds == 1 and work.cluster is None)
    unfinished = work.out is not None and not (work.out / f"{spec.name}.html").exists()
    label = f"{asked.name}-{spec.name}"
    with making(label, options, work, alone=alone, go_on=unfinished) as (place, make):
        runs = make(asked_for)
    rows = jobs.score_rows("run", runs)
    save_results(place, rows, runs)
    print_results(
        f"{asked.name} with {spec.name}", rows, draw_runs(place, runs, video), place
    )
    for run in runs:
        for said in filter(
            None,
            (
                evaluation.said_of_plans(run.episode),
                evaluation.said_of_belief(run.episode),
            ),
        ):
            print(f"{run.strategy}, seed {run.seed}: {said}")
    for row in rows:
        if row.metric == "position":
            print(f"{row.strategy}: {row.mean / spec.length:.1f} % of the arm's length")


def _check_trained(
    body: "robots.Body", strategies: tuple[str, ...], given: "jobs.GivenNetworks | None"
) -> None:
    """Networks for a body of the user's come from its own recordings, never from the simulated arm's."""
    from s2c2a.errors import S2C2AError

    untrained = [
        name for name in strategies if name != "pcc" and not (given and name == "s2c2a")
    ]
    if untrained and not body.simulated:
        raise S2C2AError(
            f"{', '.join(untrained)} would be trained on the simulated arm, and {body} is driven; `s2c2a collect` from "
            "it, `s2c2a train`, and give the file with --weights, or take --strategy pcc"
        )


def _asked(task: str, spec: "arm.ArmSpec", pace: float) -> "tasks.Task":
    """The task, and a word on every waypoint of a file that the arm cannot reach."""
    from s2c2a.errors import S2C2AError
    from s2c2a.tasks import load_waypoints, out_of_reach, task_named

    if not 0.01 <= pace <= 10:
        raise S2C2AError(
            f"a pace of {pace:g} was asked for; take 0.01 to 10, such as 0.5 for half as fast"
        )
    asked = task_named(
        task, spec.model_copy(update={"control_rate": spec.control_rate / pace})
    )
    for far in (
        out_of_reach(load_waypoints(task), spec) if task.endswith(".csv") else ()
    ):
        print(
            f"out of reach by {100 * far.gap:.1f} cm: waypoint at {far.time:g} s, module {far.module}"
        )
    return asked
