"""Sensor faults: how far a faulty sensor drives the arm, and when it is rejected."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from s2c2a import jobs
from s2c2a.arm import ArmSpec
from s2c2a.evaluation import Row, position_errors
from s2c2a.evaluation.estimates import REJECTED
from s2c2a.robots import RobotFactory
from s2c2a.spaces import Stage
from s2c2a.strategies import recipe_named
from s2c2a_experiments.run_rows import metric_rows
from s2c2a_experiments.sensors import with_sensors

EXPERIMENT = "sensor-faults"
START = 8.0  # s
SETTLING_TIME = 2.0  # s, of the approach
RECOVERY_TIME = 5.0  # s after the end of a fault
HEALTHY = "healthy"


@dataclass(frozen=True)
class SensedValue:
    """A value in readings, and the faults that are tried with it.

    Attributes:
        name: in readings.
        drift: per second, in its unit.
        noise: standard deviation, 20 times the usual one.
        offset: of the first value of every module.
    """

    name: str
    drift: float
    noise: float
    offset: float


VALUES: dict[str, tuple[SensedValue, ...]] = {
    "encoders": (SensedValue("cables", 0.001, 0.0003, 0.005),),
    "bends": (SensedValue("configurations", 0.5, 0.06, 0.4),),
    "imu": (
        SensedValue("accelerations", 10.0, 4.0, 5.0),
        SensedValue("angular_velocities", 2.0, 1.0, 0.5),
    ),
    "current": (SensedValue("tensions", 1.0, 3.0, 4.0),),
    "camera": (SensedValue("camera_positions", 0.05, 0.06, 0.1),),
}
"""By set of sensors (`sensors.SENSOR_SETS`)."""
BESIDE_ENCODERS = "imu"  # a set that finds the payload, when the encoders fail
FAULTS = (
    "drift",
    "latency",
    "noise",
    "offset",
    "negated",
    "zeros",
    "frozen",
    "reversed",
)
LATENCY = 2.0  # s


@dataclass(frozen=True)
class SensorFaultStudy:
    """What is compared.

    Attributes:
        arm: that carries the sensors.
        sets: names in `VALUES`.
        faults: names in `FAULTS`.
        durations: of the faults [s]; infinity is the rest of the run.
        payload: at the tip, unknown [kg].
        seeds: of data, training and start.
    """

    arm: ArmSpec
    sets: tuple[str, ...] = tuple(VALUES)
    faults: tuple[str, ...] = FAULTS
    durations: tuple[float, ...] = (5.0, np.inf)
    payload: float = 0.05
    seeds: tuple[int, ...] = (0,)


@dataclass(frozen=True)
class _Case:
    sensors: str
    fault: str
    duration: float

    @property
    def events(self) -> str:
        """Of the simulated robot."""
        events = []
        for value in VALUES[self.sensors]:
            amounts = {
                "drift": value.drift,
                "noise": value.noise,
                "offset": value.offset,
                "latency": LATENCY,
            }
            amount = str(amounts.get(self.fault, ""))
            events.append(f"{START} {self.fault} {value.name} {amount}")
            if np.isfinite(self.duration):
                events.append(f"{START + self.duration} repaired {value.name}")
        return "" if self.fault == HEALTHY else "; ".join(events)

    def __str__(self) -> str:
        if self.fault == HEALTHY:
            return f"{self.sensors}, {HEALTHY}"
        rest = f"{self.duration:g} s" if np.isfinite(self.duration) else "to the end"
        return f"{self.sensors}, {self.fault}, {rest}"


def sensor_fault_rows(study: SensorFaultStudy, make: jobs.Make) -> list[Row]:
    """Rows of every set of sensors, fault and duration on the circle.

    Args:
        study: what is compared.
        make: finds or makes runs, networks and recordings.
    """
    cases = []
    for sensors in study.sets:
        cases.append(_Case(sensors, HEALTHY, np.inf))
        cases += [
            _Case(sensors, fault, duration)
            for fault in study.faults
            for duration in study.durations
        ]
    rows = []
    groups = [_jobs(study, case) for case in cases]
    for case, runs in zip(cases, jobs.in_groups(make, groups), strict=True):
        rows += _rows(case, runs)
    return rows


def _jobs(study: SensorFaultStudy, case: _Case) -> list[jobs.Job]:
    robot = RobotFactory.simulation(payload=study.payload, events=case.events)
    sensors = BESIDE_ENCODERS if case.sensors == "encoders" else case.sensors
    return jobs.jobs_for(
        ["circle"],
        with_sensors(study.arm, sensors),
        ["s2c2a"],
        study.seeds,
        recipe_named("best"),
        jobs.Conditions(robot, may_end_early=True),
    )


def _rows(case: _Case, runs: Sequence[jobs.Run]) -> list[Row]:
    """Worst error before and from the fault on, and the time until a rejection.

    Only steps before the arm moves to rest count; one that does has not recovered.
    """
    errors = [_errors(run) for run in runs]
    rate = runs[0].job.arm.control_rate
    start = round(START * rate)
    settled = round(SETTLING_TIME * rate)
    metrics = {
        ("worst error before", "cm"): [each[settled:start].max() for each in errors],
        ("worst error", "cm"): [each[start:].max() for each in errors],
    }
    recovered = START + case.duration + RECOVERY_TIME
    if np.isfinite(recovered) and not any(_ended_early(run) for run in runs):
        first = round(recovered * rate)
        after = [each[first:].max() for each in errors]
        metrics["worst error after recovery", "cm"] = after
    rejected = [_rejection_time(run, start) for run in runs]
    if case.fault != HEALTHY and np.isfinite(rejected).all():
        metrics["time to rejection", "s"] = rejected
    return metric_rows(EXPERIMENT, runs, str(case), metrics)


def _errors(run: jobs.Run) -> Float[np.ndarray, " steps"]:
    """Distance of the tip from its target [cm]; the target waits while the arm holds."""
    states = run.episode.after("states")
    steps = np.arange(len(states))
    runs = run.episode.ran("stage") == Stage.RUN
    last_run = np.maximum.accumulate(np.where(runs, steps, 0))
    return position_errors(states, run.job.task.desired_positions()[last_run])


def _ended_early(run: jobs.Run) -> bool:
    """Whether the arm was moved to rest because of the fault."""
    return "interrupted" in run.episode.options


def _rejection_time(run: jobs.Run, start: int) -> float:
    """From the beginning of the fault [s]; infinity if no sensor is rejected.

    The arm holds while a reading is refused; other sensors are rejected alone.
    """
    columns = [name for name in run.episode.columns if name.startswith(REJECTED)]
    is_rejected = run.episode.ran("stage") == Stage.HOLD
    for name in columns:
        is_rejected |= run.episode.ran(name) > 0
    if not is_rejected[start:].any():
        return np.inf
    return float(np.argmax(is_rejected[start:])) / run.job.arm.control_rate
