"""The study of repetition: its runs, and a row for every repetition."""

import pytest

from s2c2a_experiments.repetition import RepetitionStudy, repetition_rows


def test_every_arm_and_task_is_repeated_with_a_camera(twin):
    class RequestedError(Exception):
        pass

    def make(jobs):
        raise RequestedError(jobs)

    study = RepetitionStudy((twin,), ("circle", "tilt-50"), repetitions=3)
    with pytest.raises(RequestedError) as requested:
        repetition_rows(study, make)
    jobs = requested.value.args[0]
    assert [job.task.name for job in jobs] == ["circle", "tilt-50"]
    assert {job.repetitions for job in jobs} == {3}
    assert all(job.arm.sensors.camera for job in jobs)
