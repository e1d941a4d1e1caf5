"""Stability: whether the loop makes the arm vibrate, over arms, sensors and payloads.

Points are held for a minute, since vibration can take half a minute to build up; and the
circle is followed while a force acts on the tip. The unknown payload is compared with
encoders alone that know it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from s2c2a import jobs
from s2c2a.arm import ArmSpec
from s2c2a.evaluation import Row
from s2c2a.planning import Goal
from s2c2a.spaces import POSITION
from s2c2a.tasks import Task
from s2c2a_experiments.run_rows import metric_rows
from s2c2a_experiments.sensors import (
    KNOWN_PAYLOAD,
    Case,
    last_quarter,
    mean_error,
    relative_path_length,
)

EXPERIMENT = "stability"
# of the arm's length, within reach
HELD_POINTS = ((0.25, 0.083, 0.933), (-0.167, 0.25, 0.9), (0.0, -0.25, 0.883))
APPROACH_TIME = 4.0  # s, of the hold
HOLD_TIME = 60.0  # s
LAST_SHARE = 2.0 / 3.0  # of the hold, in which the motion of the held tip counts
PUSH = "8 force 0.2 0 0; 11 force 0 0 0"
MAX_PEAK_TO_PEAK = 0.5  # cm
MAX_PATH_LENGTH = 1.3  # of the target's


@dataclass(frozen=True)
class StabilityStudy:
    """What is compared.

    Attributes:
        arms: that carry the sensors.
        sets: of sensors (`sensors.SENSOR_SETS`).
        payloads: at the tip, unknown [kg].
        seeds: of data, training and start.
        hold_time: for which a point is held [s].
    """

    arms: tuple[ArmSpec, ...]
    sets: tuple[str, ...] = ("bends", "imu", "current", "camera")
    payloads: tuple[float, ...] = (0.0, 0.05, 0.1, 0.15)
    seeds: tuple[int, ...] = (0,)
    hold_time: float = HOLD_TIME


def hold_task(arm: ArmSpec, number: int, time: float) -> Task:
    """Lead the tip to one of the `HELD_POINTS`, and hold it."""
    point = arm.length * np.array(HELD_POINTS[number])
    start = np.array([0.0, 0.0, arm.length])
    steps = np.arange(1, round(time * arm.control_rate) + 1)
    shares = np.minimum(steps / (APPROACH_TIME * arm.control_rate), 1.0)
    path = start + shares[:, None] * (point - start)
    return Task.along(f"hold-point-{number + 1}", path, Goal.of(arm.module_count))


def stability_rows(study: StabilityStudy, make: jobs.Make) -> list[Row]:
    """Rows of all cases, with those of encoders that know the payload.

    Args:
        study: what is compared.
        make: finds or makes runs, networks and recordings.
    """
    cases = [
        Case(arm, name, payload)
        for arm in study.arms
        for name in (KNOWN_PAYLOAD, *study.sets)
        for payload in study.payloads
    ]
    groups = []
    for case in cases:
        for number in range(len(HELD_POINTS)):
            hold = hold_task(case.arm, number, study.hold_time)
            groups.append(case.make_jobs([hold], study.seeds))
        groups.append(case.make_jobs(["circle"], study.seeds, PUSH))
    each = len(HELD_POINTS) + 1
    rows = []
    for number, runs in enumerate(jobs.in_groups(make, groups)):
        rows += rows_of(runs, str(cases[number // each]))
    return rows


def vibrating(rows: Sequence[Row]) -> list[Row]:
    """The rows whose motion exceeds a limit."""
    limits = {
        "peak to peak, last two thirds": MAX_PEAK_TO_PEAK,
        "path length, last quarter": MAX_PATH_LENGTH,
    }
    return [row for row in rows if row.mean > limits.get(row.metric, np.inf)]


def rows_of(runs: Sequence[jobs.Run], label: str) -> list[Row]:
    """Error and motion of the tip in the runs of one case."""
    task = runs[0].task
    errors = [mean_error(run, last_quarter(run)) for run in runs]
    metrics = {("position, last quarter", "cm"): errors}
    if task == "circle":
        lengths = [relative_path_length(run, last_quarter(run)) for run in runs]
        metrics["path length, last quarter", "times"] = lengths
    else:
        spans = [_peak_to_peak(run) for run in runs]
        metrics["peak to peak, last two thirds", "cm"] = spans
    return metric_rows(EXPERIMENT, runs, label, metrics)


def _peak_to_peak(run: jobs.Run) -> float:
    """Diagonal of the box that the tip visits in the last part [cm]."""
    tip = run.episode.after("states")[:, -1, POSITION]
    held = tip[round(APPROACH_TIME * run.job.arm.control_rate) :]
    tip = held[-round(LAST_SHARE * len(tip)) :]
    return 100.0 * float(np.linalg.norm(np.ptp(tip, axis=0)))
