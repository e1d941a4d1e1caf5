"""No plan stands where its cost could fall: wrong slopes and worse shapes all around are left, and told of."""

from dataclasses import replace

import equinox as eqx
import jax
import numpy as np
import pytest
from jaxtyping import Array

from s2c2a.arm import load_arm
from s2c2a.errors import S2C2AError
from s2c2a.kinematics import ForwardModel, PCCForwardModel, bends_from_configurations
from s2c2a.planning import (
    BEST,
    NO_FALLBACK,
    PAPER,
    BatchPlanner,
    Goal,
    Notes,
    Planner,
    FallbackSearch,
)
from s2c2a.planning.fallback import LED, OTHER_START
from s2c2a.compilation import compilations

TWIN = load_arm("twin_arm")
MODEL = PCCForwardModel.of(TWIN)
STRAIGHT = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (3, 1))
ASIDE = Goal.of(3).with_position([0.2, 0.1, 0.5])
LOWER = Goal.of(3).with_position([0.0, 0.0, 0.55])
"""On the arm's axis: a straight arm could go to any side, and so goes to none."""


class Uphill(ForwardModel):
    """Constant curvature whose engaged slopes point uphill."""

    truth: PCCForwardModel
    engaged: bool = eqx.field(static=True, default=False)

    def for_planning(self) -> "Uphill":
        return replace(self, engaged=True)

    def start(self, sensed):
        return self.truth.start(sensed)

    def observe(self, sensed, memory):
        return self.truth.observe(sensed, memory)

    def predict(self, configurations, memory) -> Array:
        states = self.truth.predict(configurations, memory)
        return 2.0 * jax.lax.stop_gradient(states) - states if self.engaged else states


def planned(planner, goal, steps):
    """Plans from rest, the arm doing what was planned."""
    plans = [planner.start(STRAIGHT)]
    for _ in range(steps):
        plans.append(planner.plan(plans[-1], plans[-1].configurations, goal))
    return plans


def gap(planner, plan, goal):
    return float(
        np.linalg.norm(planner.expectation(plan).states[-1, :3] - goal.positions[-1])
    )


def told(plans):
    return [int(plan.search.notes.rescued) for plan in plans]


@pytest.fixture(scope="module")
def planner():
    return Planner(TWIN, MODEL, BEST)


@pytest.fixture(scope="module")
def misled():
    return Planner(TWIN, Uphill(MODEL), BEST)


def test_without_rescue_slopes_that_point_uphill_freeze_the_plan():
    planner = Planner(TWIN, Uphill(MODEL), replace(BEST, fallback=NO_FALLBACK))
    plans = planned(planner, ASIDE, 10)
    np.testing.assert_allclose(plans[-1].configurations, STRAIGHT, atol=1e-3)
    assert told(plans) == [0] * 11


def test_true_slopes_take_over_within_the_same_step(misled):
    plans = planned(misled, ASIDE, 60)
    assert told(plans[1:2]) == [OTHER_START]
    assert gap(misled, plans[1], ASIDE) < gap(misled, plans[0], ASIDE) - 0.01
    assert gap(misled, plans[-1], ASIDE) < 0.01


def test_a_shape_behind_worse_ones_is_led_to_and_kept(planner):
    plans = planned(planner, LOWER, 60)
    assert LED in told(plans)
    assert gap(planner, plans[-1], LOWER) < 0.01
    ends = [np.asarray(plan.configurations) for plan in plans[-10:]]
    assert np.abs(np.diff(ends, axis=0)).max() < 1e-3  # it does not come and go


def test_steps_and_bends_stay_within_their_limits_on_the_way(planner):
    bends = np.array(
        [
            bends_from_configurations(plan.configurations)
            for plan in planned(planner, LOWER, 40)
        ]
    )
    assert (
        np.rad2deg(np.linalg.norm(np.diff(bends, axis=0), axis=-1)).max() <= 4.0 + 0.01
    )
    assert np.rad2deg(np.linalg.norm(bends, axis=-1)).max() <= 47.0 + 0.01


def test_the_same_start_is_rescued_alike(planner):
    first, again = (planned(planner, LOWER, 15)[-1] for _ in range(2))
    np.testing.assert_array_equal(first.configurations, again.configurations)


def test_nothing_compiles_when_it_is_needed(planner):
    before = compilations()
    planned(planner, LOWER, 10)
    assert compilations() == before


def test_out_of_reach_the_arm_comes_to_stand(planner):
    plans = planned(planner, Goal.of(3).with_position([0.5, 0.2, 0.7]), 150)
    ends = [np.asarray(plan.configurations) for plan in plans[-20:]]
    assert np.abs(np.diff(ends, axis=0)).max() < 1e-3


def test_many_at_once_are_rescued_as_one_is(misled):
    batch = BatchPlanner(TWIN, Uphill(MODEL), BEST, chunk=2, threads=1)
    starts = np.stack([STRAIGHT, STRAIGHT])
    many = batch.plan(batch.start(starts), starts, Goal.stacked([ASIDE, Goal.of(3)]))
    alone = misled.plan(misled.start(STRAIGHT), STRAIGHT, ASIDE)
    np.testing.assert_allclose(many.configurations[0], alone.configurations, atol=2e-4)
    np.testing.assert_allclose(many.configurations[1], STRAIGHT, atol=1e-6)


def test_beside_obstacles_it_is_told_that_the_plan_stands():
    """Shapes are not led to there, for the way could meet them; what is known is told."""
    goal = LOWER.with_obstacles([[0.4, 0.4, 0.1]], [0.02])
    planner = Planner(TWIN, MODEL, BEST)
    notes = [plan.search.notes for plan in planned(planner, goal, 10)]
    assert LED not in [int(one.rescued) for one in notes]
    assert any(int(one.standing) for one in notes)


def test_the_paper_s_planner_is_left_alone():
    assert PAPER.fallback == NO_FALLBACK


@pytest.mark.parametrize(
    "numbers", [{"iterations": 0}, {"least": -1.0}, {"starts": -1}]
)
def test_numbers_that_cannot_be_are_refused(numbers):
    with pytest.raises(S2C2AError, match="asked for"):
        FallbackSearch(**numbers)


def test_notes_keep_their_places():
    assert Notes._fields[-2:] == ("rescued", "standing")
