"""A job hands its steps to a stream, which is no part of its result."""

from dataclasses import replace

import numpy as np

from s2c2a import evaluation
from s2c2a.arm import load_arm
from s2c2a.jobs import Cache, Job
from s2c2a.runtime import StepRecord, build_episode
from s2c2a.spaces import Reading, Stage
from s2c2a.strategies import recipe_named
from s2c2a.tasks import load_task

ARM = load_arm("twin_arm")


def step(number):
    reading = Reading(0.1 * number, {"cables": np.zeros((3, 3))})
    action = np.zeros((3, 3))
    return StepRecord(number, 0.1 * number, Stage.RUN, reading, None, action)


def test_steps_of_a_job_are_streamed(tmp_path, monkeypatch):
    steps = [step(number) for number in range(3)]

    def run(*_, on_step, **__):
        for each in steps:
            on_step(each)
        return build_episode(steps, ARM)

    monkeypatch.setattr(evaluation, "rollout", run)
    plain = Job(load_task("circle", ARM), ARM, "pcc", recipe_named("best"))
    shown = []
    job = replace(plain, on_step=shown.append)
    job.make(Cache(tmp_path), lambda *_: None)
    assert shown == steps
    assert job.file == plain.file
    assert job == plain
