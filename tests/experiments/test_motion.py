"""Metrics of motion on artificial runs, and the runs that the study asks for."""

from types import SimpleNamespace

import numpy as np
import pytest

from s2c2a.kinematics import configurations_from_bends
from s2c2a_experiments import motion
from s2c2a_experiments.motion import (
    MotionStudy,
    jump_metrics,
    motion_rows,
    path_metrics,
    steps_task,
    turn_task,
)


def test_the_study_asks_for_turns_paths_and_jumps_with_and_without_payload(twin, asked):
    study = MotionStudy((twin,), paths=("square",))
    names = [job.task.name for job in asked(motion_rows, study)]
    turns = [f"circle, {time} s a turn" for time in (16, 8, 5, 3)]
    assert names == [*turns, "square", "steps", "circle", "steps"]


def test_fast_turns_have_a_larger_step_limit(twin):
    same, slow = turn_task(twin, 16.0)
    able, fast = turn_task(twin, 3.0)
    assert same == twin
    assert able.step_limit_deg == 2.0 * twin.step_limit_deg
    assert len(fast.goals) < len(slow.goals) / 5


def test_jumps_come_unforeseen(twin):
    goals = list(steps_task(twin).shown_goals(twin))
    assert np.isnan(goals[0].preview).all()


def made(arm, task, tip, bends):
    states = np.zeros((len(tip) + 1, arm.module_count, 6))
    states[1:, -1, :3] = tip
    planned = np.asarray(configurations_from_bends(bends), np.float32)
    columns = {"states": states[:-1], "planned": planned}
    episode = SimpleNamespace(ran=columns.get, after=lambda name: states[1:])
    job = SimpleNamespace(arm=arm, task=task)
    return SimpleNamespace(job=job, episode=episode, task=task.name)


def test_a_jump_ends_where_the_tip_stays_near_and_its_overshoot_is_along_it(twin):
    task = steps_task(twin)
    tip = task.desired_positions()[:, -1].copy()
    waits = round(motion.JUMP_TIME * twin.control_rate)
    for number in range(1, motion.JUMPS + 1):
        first = number * waits
        back = tip[first - 1] - tip[first]
        tip[first : first + 5] = tip[first - 1]  # still there
        tip[first + 8] -= 0.1 * back  # 2 cm beyond
    run = made(twin, task, tip, np.zeros((len(tip), 3, 2)))
    (beyond,), (time,) = jump_metrics([run]).values()
    assert time == pytest.approx(1.0)  # after row 9
    assert beyond == pytest.approx(2.0, abs=0.1)


def test_a_jump_that_does_not_end_has_no_time(twin):
    task = steps_task(twin)
    tip = task.desired_positions()[:, -1].copy()
    tip[:, 2] += 0.02
    metrics = jump_metrics([made(twin, task, tip, np.zeros((len(tip), 3, 2)))])
    assert list(metrics) == [("overshoot", "cm")]


def test_plans_that_stand_and_plans_that_shake_are_seen(twin):
    _, task = turn_task(twin, 16.0)
    steps = len(task.goals)
    times = np.arange(steps) * twin.control_period
    bends = np.zeros((steps, 3, 2))
    bends[:, 0, 0] = np.deg2rad(10.0) * np.sin(1.9 * np.pi * times)
    tip = task.desired_positions()[:, -1]
    shaking = path_metrics([made(twin, task, tip, bends)])
    bends[:, 0, 0] = 0.0
    standing = path_metrics([made(twin, task, tip, bends)])
    fast = shaking["planned bends above 0.3 Hz", "deg"][0]
    # one of six bends, root mean square
    assert fast == pytest.approx(10.0 / np.sqrt(2 * 6), rel=0.1)
    assert shaking["plan stands", "%"] == [0.0]
    assert standing["plan stands", "%"][0] > 90.0
    assert standing["further way", "%"][0] == pytest.approx(0.0, abs=1.0)
