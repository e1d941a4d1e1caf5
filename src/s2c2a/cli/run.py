"""`s2c2a run`: strategies on a task."""

from dataclasses import asdict, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import tyro

from s2c2a.cli.console import (
    Events,
    FidelityName,
    GuardName,
    OptionalArm,
    OptionalFile,
    OptionalNumber,
    OptionalPath,
    OptionalRecipe,
    SceneFile,
    StrategyNames,
    Vector,
    print_results,
)
from s2c2a.cli.dependent_options import beside, effective
from s2c2a.cli.emergency import emergency_controls
from s2c2a.cli.execution import (
    ALL_CORES,
    RobotName,
    RobotOptions,
    StreamTarget,
    TrackingSource,
    Work,
    check_parallel,
    robot_factory_for,
    run_directory,
    stream_to,
    uses_recipe,
)
from s2c2a.cli.reach import arm_of, forward_model_of, has_own_networks, trained_model
from s2c2a.errors import S2C2AError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from s2c2a import arm, jobs, robots, strategies, tasks
    from s2c2a.models.forward_model import ForwardModel
    from s2c2a.tasks.projection import Projection


@beside("target", "axis")
@effective("pace", where="with a TASK", holds=lambda given: bool(given["task"]))
@effective(
    "session",
    where="with --weights FILE of `s2c2a train`",
    holds=lambda given: has_own_networks(given["weights"]),
)
@effective(
    "recipe",
    where="with a strategy that uses a recipe",
    holds=lambda given: any(map(uses_recipe, given["strategy"])),
)
def run(
    task: OptionalFile = None,
    arm: OptionalArm = None,
    target: Vector = (),
    axis: Vector = (),
    scene: SceneFile = None,
    project: bool = False,
    strategy: StrategyNames = ("s2c2a",),
    recipe: OptionalRecipe = None,
    weights: OptionalPath = None,
    session: Annotated[str, tyro.conf.arg(metavar="FILE|none")] = "",
    pace: float = 1.0,
    seed: int = 0,
    seeds: int = 1,
    robot: RobotName = "sim",
    robot_option: RobotOptions = (),
    tracking: TrackingSource = "",
    fidelity: FidelityName = "fast",
    payload: float = 0.0,
    event: Events = (),
    known_payload: float = 0.0,
    disturbance_estimation: bool = True,
    max_compensated_force: OptionalNumber = None,
    guard: GuardName = "tip",
    repeat: int = 1,
    stream: StreamTarget = "",
    work: Work = ALL_CORES,
) -> None:
    """Run strategies on a task; write results, a figure and a replay page.

    An interrupted run continues if you name its run directory with --out.

    Args:
        task: a name (circle, tilt-50, hold-end, reach-2, risk-a, flee, follow, ...), a
            file ending in .csv of waypoints (columns time, x, y, z; optional axis_x,
            axis_y, axis_z, module) or of a curve for the whole arm (x, y, z alone), or
            your own file.py:function, called with the arm.
        arm: a preset or an arm file; by default that of the weights, or twin_arm.
        target: a point to go to in place of a task [m], base frame.
        axis: end axis there, base frame, of any length.
        scene: a file of obstacles beside which the task runs (docs/guides/obstacles.md).
        project: move targets that are out of reach to the nearest that are within, by
            the model of --weights, or by arcs without.
        strategy: one or several, by name or your own file.py:Class, with options behind
            commas (name,gain=0.5); compared in one figure.
        recipe: how networks are trained and plans made; `best` by default. A weight file
            has its own; a recipe beside it must train alike, and decides how to plan.
        weights: a file of `s2c2a train`, or "shipped" for the networks of the package
            (presets, and copies with the same mechanics); without it, networks are
            trained or taken from the cache (S2C2A_CACHE sets its directory).
        session: file of `s2c2a session`; by default that beside the weights, if there
            is one. none leaves it out.
        pace: of the task; 0.5 takes twice the time, for an arm with a small step limit.
        seed: of data, training and start; the first of several.
        seeds: number of seeds; several run in parallel.
        payload: mass at the tip of the simulated arm [kg].
        event: a disturbance during the run of the simulated arm, such as "6 payload
            0.05" or "10 force 0.3 0 0" (docs/concepts/simulator.md); repeat for several.
        known_payload: mass at the tip that the strategy knows of [kg].
        disturbance_estimation: estimate payload and bend biases from sensors
            (docs/guides/sensors.md).
        max_compensated_force: largest external force at the tip that the strategy
            compensates [N]; the arm yields to larger ones.
        guard: keep the tip, or the whole arm, out of obstacles.
        repeat: how often to repeat the task. Each repetition moves the targets by the
            errors that a camera or motion capture measured in the one before; results
            are those of the last (docs/guides/sensors.md).
        stream: show every step while it runs, such as foxglove,port=9000
            (docs/guides/export.md).
        work: run directory and parallel execution.
    """
    from s2c2a import jobs, strategies
    from s2c2a.estimation import EstimationSettings
    from s2c2a.planning.reach import Reachability
    from s2c2a.tasks.projection import projected
    from s2c2a.tasks.remarks import remarks

    spec = arm_of(arm, weights)
    factory = robot_factory_for(robot, robot_option, fidelity, payload, event, tracking)
    settings = EstimationSettings(
        known_payload, disturbance_estimation, max_compensated_force
    )
    conditions = jobs.Conditions(factory, strategies.RunOptions(guard, settings))
    check_parallel(factory, work.jobs, work.cluster)
    chosen = strategies.recipe_from(recipe) if recipe else None
    given = _given_networks(weights, spec, chosen, session) if weights else None
    used_recipe = given.recipe if given else chosen or strategies.recipe_named("best")
    paced = _task(task, target, axis, spec, pace, scene)
    model = _reach_model(task, spec, weights, session, project, known_payload)
    for text in remarks(paced, spec, by_arcs=model is None):
        print(text)
    if model is not None:
        reachability = Reachability(spec, model, known_payload, guard)
        found = projected(paced, spec.length, reachability)
        print(_describe_reach(found, spec, project))
        paced = found.task if project else paced
    job_list = jobs.jobs_for(
        [paced],
        spec,
        strategy,
        jobs.checked_seeds(seed, seeds),
        used_recipe,
        conditions,
        given,
        repeat,
    )
    if given is not None and weights is not None and not factory.simulated:
        _warn_of_age(factory, spec, weights, given.session)
    _check_used(given, job_list)
    _check_trained(factory, job_list)
    jobs.check_robots(job_list)
    options = {
        "task": task,
        "target": target,
        "axis": axis,
        "project": project,
        "scene": scene and scene.read_text("utf-8"),
        "arm": spec.model_dump(mode="json"),
        "strategy": strategy,
        "recipe": asdict(used_recipe),
        "pace": pace,
        "seeds": [job.seed for job in job_list],
        "conditions": asdict(conditions),
        "weights": weights,
        "session": given and given.session and given.session.model_dump(mode="json"),
        "repeat": repeat,
    }
    if calibration := factory.describe_calibration(spec):
        print(f"tracking calibration: {calibration}")
    alone = bool(stream) or not factory.simulated
    alone = alone or (seeds == 1 and work.cluster is None)
    resume = work.out is not None and not (work.out / f"{spec.name}.html").exists()
    label = f"{paced.name}-{spec.name}"
    opened = run_directory(label, options, work, alone=alone, resume=resume)
    with (
        opened as (directory, make),
        emergency_controls(factory),
        stream_to(stream, spec) as on_step,
    ):
        runs = make([replace(job, on_step=on_step) for job in job_list])
    _report(runs, directory, f"{paced.name} with {spec.name}")


def _given_networks(
    weights: Path, spec: "arm.ArmSpec", recipe: "strategies.Recipe | None", session: str
) -> "jobs.GivenNetworks":
    """The networks of a file with its session, or those of the package."""
    from s2c2a import evaluation, jobs, strategies
    from s2c2a.strategies.files import stated_errors
    from s2c2a.strategies.shipped import shipped_file

    if not has_own_networks(weights):
        with shipped_file(spec) as path:
            return jobs.GivenNetworks.read(path, spec, recipe)
    found = strategies.session_of(weights, session)
    if found is not None:
        print(strategies.describe_use(found))
    given = jobs.GivenNetworks.read(weights, spec, recipe, found)
    if text := evaluation.describe_controller(*stated_errors(weights)):
        print(text)
    return given


def _warn_of_age(
    factory: "robots.RobotFactory",
    spec: "arm.ArmSpec",
    weights: Path,
    session: "strategies.Session | None",
) -> None:
    """Say that an arm was homed or calibrated after its model was last compared with it."""
    calibrated = factory.make(spec).last_calibration()
    if calibrated is None or not weights.exists():
        return
    compared = datetime.fromtimestamp(weights.stat().st_mtime, UTC)
    if session is not None:
        compared = max(compared, session.date)
    if calibrated.astimezone(UTC) > compared:
        print(
            f"the model was compared with the arm on {compared:%Y-%m-%d %H:%M} UTC, and "
            "the arm was homed or calibrated later, on "
            f"{calibrated.astimezone(UTC):%Y-%m-%d %H:%M} UTC: run "
            f"`s2c2a session {weights}` with the robot and its tracking"
        )


def _check_used(given: "jobs.GivenNetworks | None", jobs: "Sequence[jobs.Job]") -> None:
    """Refuse weights that belong to none of the strategies.

    Raises:
        S2C2AError: no strategy uses them.
    """
    if given is None or any(given in job.needs for job in jobs):
        return
    names = ", ".join(dict.fromkeys(job.strategy for job in jobs))
    raise S2C2AError(
        f"--weights holds networks of {given.strategy}, and --strategy is {names}; add "
        f"--strategy {given.strategy}, or leave out --weights"
    )


def _check_trained(factory: "robots.RobotFactory", jobs: "Sequence[jobs.Job]") -> None:
    """Refuse to drive a user's robot with networks of the simulated arm.

    Raises:
        S2C2AError: a strategy would be trained in simulation.
    """
    if factory.simulated:
        return
    untrained = [
        job.strategy for job in jobs if job.needs and job.needs[0] != job.weights
    ]
    if untrained:
        names = ", ".join(dict.fromkeys(untrained))
        raise S2C2AError(
            f"{names} would be trained on the simulated arm, but {factory} is driven; "
            "record it with `s2c2a collect`, train with `s2c2a train` (--strategy for "
            "another than s2c2a), give the file with --weights, or take --strategy pcc"
        )


def _task(
    name: str | None,
    target: Vector,
    axis: Vector,
    spec: "arm.ArmSpec",
    pace: float,
    scene: Path | None,
) -> "tasks.Task":
    """The task at a pace, or that of going to a target; beside the obstacles of a scene.

    Raises:
        S2C2AError: neither or both are given, or as `paced_task`, `to_point` and
            `load_scene`.
    """
    from s2c2a.tasks import load_scene, paced_task, to_point

    if name is not None and not target:
        task = paced_task(name, spec, pace)
    elif target and name is None:
        task = to_point(spec, target, axis or None)
    else:
        given = "neither was given" if name is None else "both were given"
        raise S2C2AError(
            "a task is needed, such as `s2c2a run circle`, or a point with --target "
            f"X Y Z; {given}"
        )
    if scene is None:
        return task
    loaded = load_scene(scene)
    for text in loaded.remarks():
        print(text)
    return replace(loaded.around(task, spec), name=f"{task.name}-{scene.stem}")


def _reach_model(
    task: str | None,
    spec: "arm.ArmSpec",
    weights: Path | None,
    session: str,
    project: bool,
    payload: float,
) -> "ForwardModel | None":
    """The model that tells what is out of reach; None where arcs alone tell it.

    Named tasks are made within reach of arms that bend every way; of these, they are
    checked only to be projected.

    Raises:
        S2C2AError: as `forward_model_of`, for a projection.
    """
    from s2c2a.arm import ArmGeometry
    from s2c2a.tasks import TASKS, split_pace

    is_named = task is not None and split_pace(task)[0] in TASKS
    bends_every_way = ArmGeometry.of(spec).steerable is None
    if project or (is_named and not bends_every_way):
        return forward_model_of(weights, spec, 1000.0 * payload, session)
    if is_named or weights is None:
        return None
    return trained_model(weights, spec, session)


def _describe_reach(found: "Projection", spec: "arm.ArmSpec", moves: bool) -> str:
    """Sentences on the targets that are out of reach.

    Args:
        found: where they are within.
        spec: the arm.
        moves: whether they move there.
    """
    from s2c2a.tasks.remarks import time_spans

    steps, reached = found.is_moved, found.reached
    if reached is None or not steps.any():
        return "all targets are within reach"
    missed = ~reached.within(spec.length)
    by = f"{100 * reached.position_errors[missed].max():.2f} cm"
    if turn := np.rad2deg(reached.axis_errors[missed].max()):
        by += f" or {turn:.1f} deg"
    text = f"targets of {steps.sum()} of {len(steps)} steps are out of reach, by up to {by}"
    text += ", and moved to the nearest shapes" if moves else ""
    text += f": {time_spans(steps, spec)}"
    depth = -100 * reached.clearances[missed].min()
    if round(depth, 1) > 0.0:
        text += (
            f"\nthese shapes are up to {depth:.1f} cm within obstacles: none is clear"
        )
    return text


def _report(runs: "Sequence[jobs.Run]", directory: Path, title: str) -> None:
    """Write results, print the table, and what is remarkable about each run."""
    from s2c2a import evaluation, jobs
    from s2c2a.jobs.run_folder import draw_runs, save_results

    rows = jobs.score_rows("run", runs)
    save_results(directory, rows, runs)
    print_results(title, rows, draw_runs(directory, runs), directory)
    describe_all = (
        evaluation.describe_plans,
        evaluation.describe_touches,
        evaluation.describe_run_saturation,
        evaluation.describe_lasting_error,
        evaluation.describe_disagreement,
        evaluation.describe_extrapolation,
        evaluation.describe_estimates,
        evaluation.describe_faults,
        evaluation.describe_tracking,
    )
    for run in runs:
        texts = [describe(run.episode) for describe in describe_all]
        if run.earlier:
            texts.append(jobs.describe_repetitions(run))
        for text in filter(None, texts):
            print(f"{run.strategy}, seed {run.seed}: {text}")
    for row in rows:
        if row.metric == "position":
            share = row.mean / runs[0].job.arm.length
            print(f"{row.strategy}: position error {share:.1f} % of the arm's length")
