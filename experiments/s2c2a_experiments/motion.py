"""Motion: speed, ways of the tip, jumps of the target, and how smooth plans are.

Circles are followed at several times a turn; where that is faster than the step limit
allows, with twice the limit. In `steps`, the target jumps to and fro by a third of the
arm's length, and the arm does not know it before.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import butter, sosfiltfilt

from s2c2a import jobs
from s2c2a.arm import ArmSpec
from s2c2a.evaluation import Row
from s2c2a.goals import Goal
from s2c2a.kinematics import bends_from_configurations
from s2c2a.spaces import POSITION
from s2c2a.tasks import Task, load_task
from s2c2a.tasks.circle import ROUND_TIME
from s2c2a.tasks.registry import paced_task
from s2c2a_experiments.run_rows import errors_of, metric_rows
from s2c2a_experiments.sensors import (
    SETTLING_STEPS,
    Case,
    relative_path_length,
)

EXPERIMENT = "motion"
STEPS = "steps"
CORNERS = ((0.167, -0.167, 0.95), (0.167, 0.167, 0.95))  # of the arm's length
JUMPS = 4
JUMP_TIME = 6.0  # s
NEAR = 0.01  # m; a jump is over where the tip stays nearer
SLOW = 0.3  # Hz; plans of slow paths have no reason to move faster
MOVING = 1e-4  # m in a step; a goal that moves less stands
STANDING = np.deg2rad(0.01)  # in a step; a plan that moves less stands
FASTEST_PACE = 4.0  # with the usual step limit; faster turns have twice this limit

Metrics = dict[tuple[str, str], list[float]]


@dataclass(frozen=True)
class MotionStudy:
    """What moves.

    Attributes:
        arms: without sensors.
        turn_times: of the circle [s].
        paths: names of tasks.
        seeds: of data, training and start.
        payload: unknown, with inertial sensors, for the circle and the jumps [kg];
            none if zero.
    """

    arms: tuple[ArmSpec, ...]
    turn_times: tuple[float, ...] = (16.0, 8.0, 5.0, 3.0)
    paths: tuple[str, ...] = (
        "square",
        "square@0.5",
        "eight",
        "helix",
        "star",
        "follow",
    )
    seeds: tuple[int, ...] = (0,)
    payload: float = 0.05


def steps_task(arm: ArmSpec) -> Task:
    """The target jumps between two places, unforeseen."""
    waits = round(JUMP_TIME * arm.control_rate)
    places = arm.length * np.array(CORNERS)
    path = np.concatenate(
        [np.tile(places[n % 2], (waits, 1)) for n in range(JUMPS + 1)]
    )
    task = Task.along(STEPS, path, Goal.of(arm.module_count))
    return replace(task, foreseen=False)


def turn_task(arm: ArmSpec, time: float) -> tuple[ArmSpec, Task]:
    """The circle with this time a turn, and the arm with the step limit that it needs."""
    pace = ROUND_TIME / time
    task = replace(paced_task("circle", arm, pace), name=f"circle, {time:g} s a turn")
    if pace <= FASTEST_PACE:
        return arm, task
    limit = 2.0 * arm.step_limit_deg
    return arm.model_copy(update={"step_limit_deg": limit}), task


def motion_rows(study: MotionStudy, make: jobs.Make) -> list[Row]:
    """Rows of all arms.

    Args:
        study: what moves.
        make: finds or makes runs, networks and recordings.
    """
    cases = [case for arm in study.arms for case in _cases(study, arm)]
    groups = [case.make_jobs([task], study.seeds) for case, task in cases]
    rows = []
    for (case, task), runs in zip(cases, jobs.in_groups(make, groups), strict=True):
        metrics = jump_metrics if task.name == STEPS else path_metrics
        rows += metric_rows(EXPERIMENT, runs, str(case), metrics(runs))
    return rows


def _cases(study: MotionStudy, arm: ArmSpec) -> list[tuple[Case, Task]]:
    """Arm, sensors and payload of every run, and its task."""
    turns = [turn_task(arm, time) for time in study.turn_times]
    free = Case(arm, "encoders", 0.0)
    loaded = Case(arm, "imu", study.payload)
    paths = [load_task(name, arm) for name in study.paths]
    cases = [(replace(free, arm=able), task) for able, task in turns]
    cases += [(free, task) for task in (*paths, steps_task(arm))]
    if study.payload:
        cases += [
            (loaded, task) for task in (load_task("circle", arm), steps_task(arm))
        ]
    return cases


def path_metrics(runs: Sequence[jobs.Run]) -> Metrics:
    """Error, way beyond that of the target, and smoothness of plans."""
    ways = [relative_path_length(run, SETTLING_STEPS) - 1.0 for run in runs]
    return {
        ("position", "cm"): [_scored_error(run) for run in runs],
        ("further way", "%"): [100.0 * way for way in ways],
        ("planned bends above 0.3 Hz", "deg"): [_fast_bends(run) for run in runs],
        ("plan stands", "%"): [_standing(run) for run in runs],
    }


def _scored_error(run: jobs.Run) -> float:
    """Mean distance of the tip from its target in the steps that count [cm]."""
    errors = errors_of(run)
    steps = run.job.task.scores[0].steps
    return float(np.nanmean(errors if steps is None else errors[steps]))


def jump_metrics(runs: Sequence[jobs.Run]) -> Metrics:
    """Time until near, and way beyond the target, mean over the jumps.

    There is no time where the tip has not come to rest near the target in a jump.
    """
    jumps = np.array([_jumps(run) for run in runs])
    times, beyond = jumps.mean(axis=1).T
    metrics: Metrics = {("overshoot", "cm"): beyond.tolist()}
    if np.isfinite(times).all():
        metrics["until within 1 cm", "s"] = times.tolist()
    return metrics


def _jumps(run: jobs.Run) -> list[tuple[float, float]]:
    """Time until the tip stays near [s], and way beyond [cm], of every jump."""
    arm = run.job.arm
    waits = round(JUMP_TIME * arm.control_rate)
    places = arm.length * np.array(CORNERS)
    tip = run.episode.after("states")[:, -1, POSITION]
    found = []
    for number in range(1, JUMPS + 1):
        there = places[number % 2]
        jump = there - places[(number + 1) % 2]
        way = tip[number * waits : (number + 1) * waits] - there
        direction = jump / np.linalg.norm(jump)
        is_far = np.linalg.norm(way, axis=-1) > NEAR
        # row j is j + 1 periods after the jump; one that never ends has no time
        near = np.argmax(is_far[::-1])
        steps = len(way) - near + 1 if is_far.any() else 1
        time = np.nan if is_far[-1] else steps / arm.control_rate
        beyond = max(0.0, float((way @ direction).max()))
        found.append((time, 100.0 * beyond))
    return found


def _planned(run: jobs.Run) -> np.ndarray:
    bends = np.asarray(bends_from_configurations(run.episode.ran("planned")))
    return bends.reshape(len(bends), -1)


def _fast_bends(run: jobs.Run) -> float:
    """Root mean square of the planned bends above `SLOW` [deg]."""
    rate = run.job.arm.control_rate
    filtered = butter(2, SLOW, "high", fs=rate, output="sos")
    fast = sosfiltfilt(filtered, _planned(run)[SETTLING_STEPS:], axis=0)
    return float(np.rad2deg(np.sqrt(np.mean(fast**2))))


def _standing(run: jobs.Run) -> float:
    """Share of the steps in which the goal moves and the plan does not [%]."""
    changes = np.diff(_planned(run), axis=0)
    steps = np.abs(changes).max(axis=-1)
    desired = run.job.task.desired_positions()[:, -1]
    moves = np.linalg.norm(np.diff(desired, axis=0), axis=-1) > MOVING
    count = min(len(steps), len(moves))
    stands = moves[:count] & (steps[:count] < STANDING)
    return float(100.0 * stands.sum() / max(moves.sum(), 1))
