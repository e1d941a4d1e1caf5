"""Batches give the plans of the planner; the best of many starts beats a single one."""

from dataclasses import replace

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.errors import TargetError
from s2c2a.estimation import Estimate
from s2c2a.kinematics import states_from_configurations
from s2c2a.models.forward_model import PCCForwardModel
from s2c2a.planning import BEST, NO_FALLBACK, PAPER, BatchPlanner, Goal, Planner
from s2c2a.planning.terms import Axes

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
BOTH = pytest.mark.parametrize("options", [PAPER, BEST], ids=["adam", "least squares"])


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
    "obstacles", [{}, {"centers": [[0.1, 0.0, 0.55]], "thresholds": [0.05]}]
)
def test_each_plan_is_that_of_the_planner(batch_of, options, obstacles):
    """Five plans in chunks of four: the last chunk is padded."""
    batch = batch_of(options)
    planner = Planner(*PARTS, options)
    desired = goals(**obstacles)
    sensed = somewhere(5)
    many = batch.plan(batch.start(sensed), sensed, Goal.stacked(desired))
    each = [
        planner.plan(planner.start(Estimate(one)), Estimate(one), goal).configurations
        for one, goal in zip(sensed, desired, strict=True)
    ]
    np.testing.assert_allclose(many.configurations, each, atol=2e-4)


@BOTH
def test_a_path_has_the_plans_of_single_steps(batch_of, options):
    batch = batch_of(options)
    planner = Planner(*PARTS, options)
    start = somewhere(1)[0]
    desired = [Goal.of(3).with_position([0.02 * step, 0.01, 0.59]) for step in range(6)]
    path = batch.path(start, Goal.stacked(desired))
    plan = planner.start(Estimate(start))
    each = []
    for goal in desired:
        plan = planner.plan(plan, Estimate(plan.configurations), goal)
        each.append(plan.configurations)
    np.testing.assert_allclose(path.configurations, each, atol=1e-3)
    np.testing.assert_allclose(
        path.states[:, -1, :3], tips(path.configurations), atol=1e-6
    )


def test_the_best_of_many_starts_ends_at_least_as_well_as_each(batch_of):
    batch = batch_of(BEST)
    starts = somewhere(6)
    best = batch.best(starts, Goal.of(3).with_position([0.15, 0.1, 0.52]), steps=25)
    assert best.values.shape == (6,)
    assert best.value == best.values.min() == best.values[best.start]
    assert np.linalg.norm(tips(best.configurations) - [0.15, 0.1, 0.52]) < 0.002


def test_many_starts_leave_a_local_minimum(batch_of):
    """The target is on the axis: a straight arm has no preferred side."""
    goal = Goal.of(3).with_position([0.0, 0.0, 0.5]).with_axis([0.0, 0.0, 1.0])
    # weights as in the objective that ranks the starts
    even = tuple(Axes() if isinstance(term, Axes) else term for term in BEST.terms)
    batch = batch_of(replace(BEST, fallback=NO_FALLBACK, terms=even))
    best = batch.best(np.concatenate([STRAIGHT, somewhere(7)]), goal, steps=40)
    assert best.value < 0.9 * best.values[0]


def test_results_do_not_depend_on_threads():
    desired = Goal.stacked(goals())
    sensed = somewhere(5)
    results = []
    for threads in (1, 3):
        batch = BatchPlanner(*PARTS, PAPER, chunk=2, threads=threads)
        results.append(batch.plan(batch.start(sensed), sensed, desired).configurations)
    np.testing.assert_array_equal(*results)


def test_invalid_counts_are_rejected(batch_of):
    batch = batch_of(PAPER)
    sensed = somewhere(3)
    with pytest.raises(TargetError, match="3 plans, 3 sensed arms and 5 goals"):
        batch.plan(batch.start(sensed), sensed, Goal.stacked(goals()))
    with pytest.raises(TargetError, match="at least one, all finite"):
        batch.best(sensed[:0], Goal.of(3))
    with pytest.raises(TargetError, match="all finite"):
        batch.start(np.full((2, 3, 3), np.nan))
    with pytest.raises(TargetError, match="0 steps"):
        batch.best(sensed, Goal.of(3), steps=0)
    with pytest.raises(TargetError, match="at least 1"):
        BatchPlanner(*PARTS, PAPER, chunk=0)
    with pytest.raises(TargetError, match="at least one"):
        Goal.stacked([])
    with pytest.raises(TargetError, match="different arms"):
        Goal.stacked([Goal.of(3), Goal.of(2)])
