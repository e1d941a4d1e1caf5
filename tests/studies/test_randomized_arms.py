"""Randomized arms through the protocol: what is asked, what rows say, and what counts as running away."""

from dataclasses import replace
from types import SimpleNamespace
from typing import get_args

import numpy as np
import pytest

from s2c2a import jobs
from s2c2a.arm import load_arm
from s2c2a.cli.experiments import Compared
from s2c2a.errors import S2C2AError
from s2c2a.goals import Goal
from s2c2a.strategies import recipe_named
from s2c2a.studies import true_reach, randomized_arms
from s2c2a.studies.targets import Held
from s2c2a.studies.randomized_arms import (
    AGED,
    STRATEGIES,
    TASKS,
    Unknown,
    held_rows,
    over_arms,
    randomized_arms_rows,
)
from s2c2a.tasks import Task

TWIN = load_arm("twin_arm")
STEPS = 50


def held_run(tips: np.ndarray, targets: np.ndarray) -> tuple[jobs.Run, Held]:
    """A run whose tip was somewhere after every step, and whose targets were held for five seconds each."""
    goals = tuple(
        Goal.of(3).with_position(target) for target in targets for _ in range(STEPS)
    )
    task = Task("held", goals)
    states = np.zeros((len(tips), 3, 6))
    states[:, -1, :3], states[..., 5] = tips, 1.0
    episode = SimpleNamespace(after=lambda name: states)
    job = jobs.Job(task, TWIN, "pcc", recipe_named("best"), 0, AGED)
    return SimpleNamespace(
        job=job, episode=episode, task="held", strategy="pcc", seed=0
    ), Held(task, np.zeros(len(targets)))


def numbers(rows) -> dict:
    return {row.metric: row.mean for row in rows}


def test_distances_count_at_the_end_of_every_target_alone():
    """Two targets; the tip is 1 cm from the first at the end of its time, 7 cm from the second, and far off before."""
    targets = np.array([[0.1, 0.0, 0.5], [-0.1, 0.0, 0.5]])
    tips = np.full((2 * STEPS, 3), 9.0)
    tips[STEPS - 1], tips[-1] = (
        targets[0] + [0.0, 0.01, 0.0],
        targets[1] + [0.0, 0.0, 0.07],
    )
    found = numbers(held_rows(*held_run(tips, targets)))
    assert found["distance"] == pytest.approx(4.0)
    assert found["distance, largest"] == pytest.approx(7.0)
    assert found["runaways"] == pytest.approx(0.5)


def test_out_of_reach_the_nearest_is_taken_off_and_the_last_second_must_be_still():
    """The tip ends 12 cm off where 10 cm is the nearest; in the last second it swings by 3 cm, before by more."""
    targets = np.array([[0.0, 0.0, 0.8]])
    tips = np.tile(targets[0] - [0.0, 0.0, 0.12], (STEPS, 1))
    tips[:30, 0], tips[-6, 0] = 0.5, 0.03
    run, held = held_run(tips, targets)
    found = numbers(held_rows(run, held._replace(distances=np.array([0.10]))))
    assert found["distance"] == pytest.approx(2.0)
    assert found["runaways"] == 0
    assert found["moved in the last second, largest"] == pytest.approx(3.0)


def test_over_arms_stand_the_mean_and_the_worst():
    run, held = held_run(np.zeros((STEPS, 3)), np.array([[0.0, 0.0, 0.02]]))
    (row, *_) = held_rows(run, held)
    rows = [
        [replace(row, arm=f"arm_{arm}", mean=mean)]
        for arm, mean in enumerate((1.0, 2.0, 6.0))
    ]
    mean, worst = over_arms(rows, 0.5)
    assert (mean.arm, mean.mean, mean.task) == ("mean of 3 arms at 0.5", 3.0, "held")
    assert (worst.arm, worst.mean) == ("worst of 3 arms at 0.5", 6.0)
    assert (mean.first_mode_hz, mean.experiment) == (None, "randomised-arms")


@pytest.mark.parametrize(
    "wrong", [{"arms": 0}, {"targets": -1}, {"strategies": ("mpc",)}, {"strengths": ()}]
)
def test_what_cannot_be_tried_is_refused(wrong):
    with pytest.raises(S2C2AError):
        Unknown(TWIN, **wrong)


def test_each_strength_has_its_arms():
    drawn = Unknown(TWIN, arms=2, strengths=(0.5, 1.0)).drawn()
    assert [strength for strength, _ in drawn] == [0.5, 0.5, 1.0, 1.0]
    assert len({arm.name for _, arm in drawn}) == 4


def test_runs_are_of_aged_arms_and_data_of_young_ones():
    trial = randomized_arms.Trial(
        0.5, TWIN, "pcc-fitted", (Task("still", (Goal.of(3),)),), ()
    )
    (job,) = trial.to_run(seed=4)
    assert dict(job.conditions.body.options)["aged"] == 1.0
    assert (job.strategy, job.recipe.name, job.seed) == ("pcc-fitted", "best", 4)
    assert "aged" not in dict(jobs.artifacts.DATA.options)


@pytest.mark.parametrize("strength", [0.5, 1.0])
def test_from_a_strength_on_targets_are_put_within_reach(strength):
    asked = Unknown(TWIN, arms=1, strengths=(strength,), strategies=("pcc",), targets=7)
    seen = []

    def make(artifacts):
        seen.extend(artifacts)
        return [SimpleNamespace(task=Task("held", (Goal.of(3),))) for _ in artifacts]

    randomized_arms._trials(asked, make)
    names = [one.name for one in seen if hasattr(one, "name")]
    assert names == (list(TASKS) if strength == 1.0 else [])
    assert [(one.count, one.beyond) for one in seen if hasattr(one, "count")] == [
        (7, False),
        (20, True),
    ]


def test_a_whole_trial_makes_rows_of_tasks_and_of_targets(tmp_path, monkeypatch):
    """Of `pcc`, which needs no data."""
    monkeypatch.setattr(randomized_arms, "BEYOND", 1)
    monkeypatch.setattr(true_reach, "SAMPLES", 64)
    (tmp_path / "out.csv").write_text("time,x,y,z\n0.1,0,0,0.6\n1.5,0.08,0,0.57\n")
    asked = Unknown(TWIN, 1, (0.5,), ("pcc",), (str(tmp_path / "out.csv"),), targets=2)
    rows = randomized_arms_rows(
        asked, lambda artifacts: jobs.make_all(artifacts, jobs.Cache(tmp_path))
    )
    told = {(row.arm, row.task, row.metric): row for row in rows}
    assert {row.experiment for row in rows} == {"randomised-arms"}
    assert told["twin_arm_50_0", "out", "position"].mean < 20.0
    assert told["twin_arm_50_0", "out", "position"].first_mode_hz > 0
    assert (
        told["mean of 1 arms at 0.5", "held", "distance"].mean
        == told["twin_arm_50_0", "held", "distance"].mean
    )
    assert (
        "worst of 1 arms at 0.5",
        "beyond",
        "moved in the last second, largest",
    ) in told
    assert np.isfinite([row.mean for row in rows]).all()


def test_the_command_offers_every_strategy():
    assert set(get_args(Compared)) == set(STRATEGIES)
