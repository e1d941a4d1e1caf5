"""The study of sensor faults: its cases, and the rows of finished runs."""

import numpy as np

from s2c2a.robots.simulation.events import parse_events
from s2c2a_experiments.sensor_faults import (
    FAULTS,
    VALUES,
    SensorFaultStudy,
    sensor_fault_rows,
)


def events_of(job):
    """Events of the robot of a job."""
    return parse_events(dict(job.conditions.robot.options).get("events", ""))


def test_every_set_runs_healthy_and_with_each_fault_for_each_duration(twin, asked):
    jobs = asked(sensor_fault_rows, SensorFaultStudy(twin))
    assert len(jobs) == len(VALUES) * (1 + len(FAULTS) * 2)
    assert sum(not events_of(job) for job in jobs) == len(VALUES)


def test_a_fault_with_an_end_is_repaired(twin, asked):
    study = SensorFaultStudy(twin, ("camera",), ("offset",), (5.0, np.inf))
    _, brief, lasting = asked(sensor_fault_rows, study)
    events = events_of(brief)
    assert [(event.time, event.kind) for event in events] == [
        (8.0, "offset"),
        (13.0, "repaired"),
    ]
    assert len(events_of(lasting)) == 1
