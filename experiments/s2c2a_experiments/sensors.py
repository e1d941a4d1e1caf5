"""Sensors compared: sets of them beside encoders, under unknown payloads."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from s2c2a import jobs
from s2c2a.arm import ArmSpec
from s2c2a.arm.sensors import Camera, Flex, Inertial, Sensors
from s2c2a.estimation import EstimationSettings
from s2c2a.evaluation import Row
from s2c2a.robots import RobotFactory
from s2c2a.spaces import POSITION
from s2c2a.strategies import RunOptions, recipe_named
from s2c2a.tasks import Task
from s2c2a_experiments.run_rows import errors_of, labeled, metric_rows

EXPERIMENT = "sensors"
CURRENT = {"current_noise": 0.15, "current_friction": 0.2}
"""Of a motor such as the XL330 on a pulley of 10 mm [N]."""
MOTION_CAPTURE = Camera(rate=10.0, delay=0.02, lost=0.0, sees="ends")
SENSOR_SETS: dict[str, Sensors] = {
    "encoders": Sensors(),
    "bends": Sensors(bends=True),
    "imu": Sensors(imu=Inertial()),
    "current": Sensors(),
    "camera": Sensors(camera=Camera()),
    "flex": Sensors(flex=Flex()),
    "motion-capture": Sensors(camera=MOTION_CAPTURE),
    "imu-current-camera": Sensors(imu=Inertial(), camera=Camera()),
}
"""Sensors beside encoders; `current` in a name adds the motors' currents."""
KNOWN_PAYLOAD = "encoders-known-payload"
"""Encoders alone, and a strategy that knows the payload."""
SETTLING_STEPS = 20  # after which the path length of the tip counts
MIN_PATH = 0.01  # m; a target with a shorter path is at rest
LAST_QUARTER = 0.75  # of a run; what follows is also scored on its own


@dataclass(frozen=True)
class SensorStudy:
    """What is compared.

    Attributes:
        arm: that carries the sensors.
        sets: names in `SENSOR_SETS`, or `KNOWN_PAYLOAD`.
        payloads: at the tip [kg].
        tasks: names.
        seeds: of data, training and start.
    """

    arm: ArmSpec
    sets: tuple[str, ...] = (
        "encoders",
        "encoders-known-payload",
        "bends",
        "imu",
        "current",
        "camera",
        "motion-capture",
        "flex",
        "imu-current-camera",
    )
    payloads: tuple[float, ...] = (0.0, 0.05, 0.1)
    tasks: tuple[str, ...] = ("circle",)
    seeds: tuple[int, ...] = (0, 1, 2)


@dataclass(frozen=True)
class Case:
    """One cell of the study.

    Attributes:
        arm: without sensors.
        sensors: name of their set.
        payload: at the tip [kg].
    """

    arm: ArmSpec
    sensors: str
    payload: float

    def __str__(self) -> str:
        """What stands in place of the strategy's name."""
        return f"{self.sensors}, {1000 * self.payload:g} g"

    def make_jobs(
        self, tasks: Sequence[str | Task], seeds: Sequence[int], events: str = ""
    ) -> list[jobs.Job]:
        """Runs of tasks, once a seed."""
        known = self.payload if self.sensors == KNOWN_PAYLOAD else 0.0
        robot = RobotFactory.simulation(payload=self.payload, events=events)
        run = RunOptions(estimation=EstimationSettings(known_payload=known))
        return jobs.jobs_for(
            tasks,
            with_sensors(self.arm, self.sensors),
            ["s2c2a"],
            seeds,
            recipe_named("best"),
            jobs.Conditions(robot, run),
        )


def with_sensors(arm: ArmSpec, name: str) -> ArmSpec:
    """An arm with a set of sensors."""
    currents = CURRENT if "current" in name else {"current_noise": None}
    sensors = SENSOR_SETS.get(name, Sensors())
    motor = arm.motor.model_copy(update=currents)
    return arm.model_copy(update={"sensors": sensors, "motor": motor})


def sensor_rows(study: SensorStudy, make: jobs.Make) -> list[Row]:
    """Result rows of every case.

    Args:
        study: what is compared.
        make: finds or makes runs, networks and recordings.
    """
    cases = [
        Case(study.arm, name, payload)
        for name in study.sets
        for payload in study.payloads
    ]
    groups = [case.make_jobs(study.tasks, study.seeds) for case in cases]
    rows = []
    for case, runs in zip(cases, jobs.in_groups(make, groups), strict=True):
        rows += _rows(runs, str(case))
    return rows


def _rows(runs: Sequence[jobs.Run], label: str) -> list[Row]:
    """Scores, relative path length of the tip, and both in the last quarter."""
    rows = labeled(jobs.score_rows(EXPERIMENT, runs), label)
    for task in dict.fromkeys(run.task for run in runs):
        of_task = [run for run in runs if run.task == task]
        late = last_quarter(of_task[0])
        metrics = {
            ("path length", "times"): [
                relative_path_length(run, SETTLING_STEPS) for run in of_task
            ],
            ("path length, last quarter", "times"): [
                relative_path_length(run, late) for run in of_task
            ],
            ("position, last quarter", "cm"): [
                mean_error(run, late) for run in of_task
            ],
        }
        known = {
            names: values
            for names, values in metrics.items()
            if np.isfinite(values).all()
        }
        rows += metric_rows(EXPERIMENT, of_task, label, known)
    return rows


def last_quarter(run: jobs.Run) -> int:
    """The first step of the last quarter."""
    return int(LAST_QUARTER * len(run.job.task.desired_positions()))


def mean_error(run: jobs.Run, first: int) -> float:
    """Mean distance of the tip from its target, from a step on [cm]; NaN without one."""
    errors = errors_of(run)[first:]
    errors = errors[np.isfinite(errors)]
    return float(errors.mean()) if len(errors) else np.nan


def relative_path_length(run: jobs.Run, first: int) -> float:
    """Path length of the tip over that of its target; NaN for a target at rest."""
    desired = run.job.task.desired_positions()[:, -1]
    tip = run.episode.after("states")[: len(desired), -1, POSITION]
    desired_length = _path_length(desired[first:])
    if desired_length <= MIN_PATH:
        return np.nan
    return _path_length(tip[first:]) / desired_length


def _path_length(positions: np.ndarray) -> float:
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=-1)
    return float(np.nansum(steps))
