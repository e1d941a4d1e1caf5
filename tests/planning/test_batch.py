"""Batches give the plans of the planner without guides, in any chunks and on any threads."""

from dataclasses import replace

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.errors import TargetError
from s2c2a.estimation import Estimate
from s2c2a.kinematics import states_from_configurations
from s2c2a.models.forward_model import PCCForwardModel
from s2c2a.planning import BEST, PAPER, BatchPlanner, Goal, Planner

from marks import slow_after

TWIN = load_arm("twin_arm")
PARTS = TWIN, PCCForwardModel.of(TWIN)
CHUNK = 4
STRAIGHT = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (1, 3, 1))
TARGETS = np.array(
    [
        [0.1, 0.05, 0.55],
        [-0.2, 0.1, 0.5],
        [0.0, -0.15, 0.55],
        [0.05, 0.2, 0.5],
        [0.2, 0.2, 0.45],
    ]
)
BOTH = pytest.mark.parametrize("options", slow_after(1, [BEST, PAPER]))


@pytest.fixture(scope="module")
def batch_of():
    made = {}

    def of(options) -> BatchPlanner:
        return made.setdefault(
            options, BatchPlanner(*PARTS, options, chunk=CHUNK, threads=2)
        )

    return of


def somewhere(count, seed=0):
    """Configurations a little bent, shape (count, 3, 3)."""
    bent = np.random.default_rng(seed).normal(
        [0.1, 0.05, 1.0], [0.1, 0.1, 0.0], (count, 3, 3)
    )
    return (bent / np.linalg.norm(bent, axis=-1, keepdims=True)).astype(np.float32)


def tips(configurations):
    return np.asarray(states_from_configurations(configurations, PARTS[1].lengths))[
        ..., -1, :3
    ]


def goals(**obstacles):
    desired = [Goal.of(3).with_position(target) for target in TARGETS]
    return [goal.with_obstacles(**obstacles) if obstacles else goal for goal in desired]


@BOTH
@pytest.mark.parametrize(
    "obstacles",
    slow_after(1, [{"centers": [[0.1, 0.0, 0.55]], "thresholds": [0.05]}, {}]),
)
def test_each_plan_is_that_of_the_planner(batch_of, options, obstacles):
    """Five plans in chunks of four: the last chunk is padded."""
    batch = batch_of(options)
    planner = Planner(*PARTS, replace(options, guides=()))
    desired = goals(**obstacles)
    sensed = somewhere(5)
    many = batch.plan(batch.start(sensed), sensed, Goal.stacked(desired))
    each = [
        planner.plan(planner.start(Estimate(one)), Estimate(one), goal).configurations
        for one, goal in zip(sensed, desired, strict=True)
    ]
    np.testing.assert_allclose(many.configurations, each, atol=2e-4)


@pytest.mark.slow
def test_results_do_not_depend_on_threads():
    desired = Goal.stacked(goals())
    sensed = somewhere(5)
    results = []
    for threads in (1, 3):
        batch = BatchPlanner(*PARTS, PAPER, chunk=2, threads=threads)
        results.append(batch.plan(batch.start(sensed), sensed, desired).configurations)
    np.testing.assert_array_equal(*results)


@pytest.mark.slow
def test_invalid_counts_are_rejected(batch_of):
    batch = batch_of(PAPER)
    sensed = somewhere(3)
    with pytest.raises(TargetError, match="3 plans, 3 sensed arms and 5 goals"):
        batch.plan(batch.start(sensed), sensed, Goal.stacked(goals()))
    with pytest.raises(TargetError, match="at least one, all finite"):
        batch.start(sensed[:0])
    with pytest.raises(TargetError, match="all finite"):
        batch.start(np.full((2, 3, 3), np.nan))
    with pytest.raises(TargetError, match="at least 1"):
        BatchPlanner(*PARTS, PAPER, chunk=0)
    with pytest.raises(TargetError, match="at least one"):
        Goal.stacked([])
    with pytest.raises(TargetError, match="different arms"):
        Goal.stacked([Goal.of(3), Goal.of(2)])
