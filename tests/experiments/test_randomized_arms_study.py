"""The study of randomized arms: its runs, its rows, and the definition of a runaway."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from s2c2a import jobs
from s2c2a.arm import load_arm
from s2c2a.goals import Goal
from s2c2a.strategies import recipe_named
from s2c2a.tasks import Task, load_task
from s2c2a_experiments import randomized_arms, true_reach
from s2c2a_experiments.randomized_arms import (
    AGED,
    TASKS,
    RandomizedArmsStudy,
    over_arms,
    randomized_arms_rows,
    target_rows,
)
from s2c2a_experiments.targets import TargetSequence

TWIN = load_arm("twin_arm")
STEPS = 50


def held_run(tips: np.ndarray, targets: np.ndarray) -> tuple[jobs.Run, TargetSequence]:
    """A run with given tip positions whose targets were held for five seconds each."""
    goals = tuple(
        Goal.of(3).with_position(target) for target in targets for _ in range(STEPS)
    )
    task = Task("held", goals)
    states = np.zeros((len(tips), 3, 6))
    states[:, -1, :3] = tips
    states[..., 5] = 1.0
    episode = SimpleNamespace(after=lambda name: states)
    job = jobs.Job(task, TWIN, "pcc", recipe_named("best"), 0, AGED)
    return SimpleNamespace(
        job=job, episode=episode, task="held", strategy="pcc", seed=0
    ), TargetSequence(task, np.zeros(len(targets)))


def numbers(rows) -> dict:
    return {row.metric: row.mean for row in rows}


def test_distances_count_at_the_end_of_each_target_only():
    """The tip ends 1 cm from the first target and 7 cm from the second."""
    targets = np.array([[0.1, 0.0, 0.5], [-0.1, 0.0, 0.5]])
    tips = np.full((2 * STEPS, 3), 9.0)
    tips[STEPS - 1] = targets[0] + [0.0, 0.01, 0.0]
    tips[-1] = targets[1] + [0.0, 0.0, 0.07]
    result = numbers(target_rows(*held_run(tips, targets)))
    assert result["distance"] == pytest.approx(4.0)
    assert result["distance, largest"] == pytest.approx(7.0)
    assert result["runaways"] == pytest.approx(0.5)


def test_the_smallest_possible_distance_is_subtracted_and_late_motion_counts():
    """The tip ends 12 cm off, at best 10 cm; it moves 3 cm in the last second."""
    targets = np.array([[0.0, 0.0, 0.8]])
    tips = np.tile(targets[0] - [0.0, 0.0, 0.12], (STEPS, 1))
    tips[:30, 0] = 0.5
    tips[-6, 0] = 0.03
    run, targets = held_run(tips, targets)
    result = numbers(target_rows(run, targets._replace(distances=np.array([0.10]))))
    assert result["distance"] == pytest.approx(2.0)
    assert result["runaways"] == 0
    assert result["moved in the last second, largest"] == pytest.approx(3.0)


def test_the_summary_over_arms_has_the_mean_and_the_worst():
    run, targets = held_run(np.zeros((STEPS, 3)), np.array([[0.0, 0.0, 0.02]]))
    (row, *_) = target_rows(run, targets)
    rows = [
        [replace(row, arm=f"arm_{arm}", mean=mean)]
        for arm, mean in enumerate((1.0, 2.0, 6.0))
    ]
    mean, worst = over_arms(rows, 0.5)
    assert (mean.arm, mean.mean, mean.task) == ("mean of 3 arms at 0.5", 3.0, "held")
    assert (worst.arm, worst.mean) == ("worst of 3 arms at 0.5", 6.0)
    assert (mean.first_mode_hz, mean.experiment) == (None, "randomised-arms")


@pytest.mark.parametrize("strength", [0.5, 1.0])
def test_goals_are_moved_within_reach_from_a_strength_on(strength):
    study = RandomizedArmsStudy(
        TWIN, arms=1, strength=strength, strategies=("pcc",), targets=7
    )
    requested = []

    def make(artifacts):
        requested.extend(artifacts)
        return [SimpleNamespace(task=Task("held", (Goal.of(3),))) for _ in artifacts]

    randomized_arms._trials(study, make)
    names = [one.name for one in requested if hasattr(one, "name")]
    assert names == (list(TASKS) if strength == 1.0 else [])
    assert [
        (one.count, one.unreachable_waypoints)
        for one in requested
        if hasattr(one, "count")
    ] == [(7, False), (20, True)]


@pytest.mark.slow
def test_a_whole_trial_makes_rows_of_tasks_and_of_targets(tmp_path, monkeypatch):
    """Of `pcc`, which needs no data."""
    monkeypatch.setattr(randomized_arms, "UNREACHABLE_COUNT", 1)
    monkeypatch.setattr(true_reach, "SAMPLES", 64)
    (tmp_path / "out.csv").write_text("time,x,y,z\n0.1,0,0,0.6\n1.5,0.08,0,0.57\n")
    study = RandomizedArmsStudy(
        TWIN, 1, 0.5, ("pcc",), (str(tmp_path / "out.csv"),), targets=2
    )
    rows = randomized_arms_rows(
        study, lambda artifacts: jobs.make_all(artifacts, jobs.Cache(tmp_path))
    )
    results = {(row.arm, row.task, row.metric): row for row in rows}
    assert {row.experiment for row in rows} == {"randomised-arms"}
    assert results["twin_arm_50_0", "out", "position"].mean < 20.0
    assert results["twin_arm_50_0", "out", "position"].first_mode_hz > 0
    assert (
        results["mean of 1 arms at 0.5", "held", "distance"].mean
        == results["twin_arm_50_0", "held", "distance"].mean
    )
    assert (
        "worst of 1 arms at 0.5",
        "beyond",
        "moved in the last second, largest",
    ) in results
    assert np.isfinite([row.mean for row in rows]).all()


def test_strategies_are_baselines_and_recipes():
    found = {}
    for name in ("pcc", "paper"):
        trial = randomized_arms.ArmTrial(TWIN, name, (load_task("circle", TWIN),), ())
        (job,) = trial.make_jobs(seed=0)
        found[name] = job.strategy, job.recipe.name
    assert found == {"pcc": ("pcc", "best"), "paper": ("s2c2a", "paper")}
