"""What the studies of repetition and of sensor faults ask for."""

import numpy as np

from s2c2a.robots.simulation.events import parse_events
from s2c2a_experiments.repetition import RepetitionStudy, repetition_rows, turning
from s2c2a_experiments.sensor_faults import (
    FAULTS,
    VALUES,
    SensorFaultStudy,
    sensor_fault_rows,
)


def test_every_arm_and_task_is_repeated_with_a_camera(twin, asked):
    study = RepetitionStudy((twin,), ("circle", "tilt-50"), repetitions=3)
    jobs = asked(repetition_rows, study)
    assert [job.task.name for job in jobs] == ["circle", "tilt-50"]
    assert {job.repetitions for job in jobs} == {3}
    assert all(job.arm.sensors.camera for job in jobs)


def test_without_repetitions_the_circle_turns_with_and_without_a_camera(twin):
    asked = []

    def make(jobs):
        asked.extend(jobs)
        return []

    study = RepetitionStudy((twin,), tasks=(), turns=2)
    assert repetition_rows(study, make) == []
    assert [bool(job.arm.sensors.camera) for job in asked] == [False, True]
    assert {job.task.name for job in asked} == {"circle-2-turns"}


def test_every_turn_of_the_circle_is_the_same(twin):
    one, three = (turning(twin, count).desired_positions()[:, -1] for count in (1, 3))
    turn = round(16.0 * twin.control_rate)
    assert len(three) == len(one) + 2 * turn
    np.testing.assert_array_equal(three[: len(one)], one)
    np.testing.assert_array_equal(three[-turn:], one[-turn:])


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
