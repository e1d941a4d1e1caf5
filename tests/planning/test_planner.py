"""The planner with the options of the paper and PCC as forward model."""

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from driven import TWIN, jumping_goals, states_of

from s2c2a.errors import TargetError
from s2c2a.estimation import Estimate
from s2c2a.models.forward_model import ForwardModel, PCCForwardModel
from s2c2a.planning import PAPER, Adam, Goal, Planner


def an_arm(modules=3):
    return TWIN.model_copy(update={"modules": TWIN.modules[:modules]})


def planner_of(modules=3, on_sphere=True, **options):
    arm = an_arm(modules)
    options = replace(PAPER, solver=Adam(**options), on_sphere=on_sphere)
    return Planner(arm, PCCForwardModel.of(arm), options)


@pytest.fixture(scope="module")
def paper_planner():
    """The planner of the paper's recipe with PCC as forward model."""
    return planner_of()


@pytest.fixture(scope="module")
def fine_planner():
    """A planner of many small iterations."""
    return planner_of(learning_rate=0.0005, iterations=50)


def straight(modules=3):
    return np.tile([0.0, 0.0, 1.0], (modules, 1))


def drive(planner, goals, start=None):
    """The start and all plans, shape (steps + 1, modules, 3), float64."""
    first = straight() if start is None else start
    plans = [planner.start(Estimate(first))]
    for goal in goals:
        plans.append(planner.plan(plans[-1], Estimate(first), goal))
    return np.array([plan.configurations for plan in plans], np.float64)


def angles_between(one, other):
    """Angles [deg] without loss of digits near zero."""
    across = np.linalg.norm(one - other, axis=-1)
    return np.rad2deg(2 * np.arctan2(across, np.linalg.norm(one + other, axis=-1)))


def tip_distances(planned, place):
    """Distances of the tip from a place [m], shape (steps + 1,)."""
    tips = np.asarray(states_of(planned))[:, -1, :3]
    return np.linalg.norm(tips - np.array(place), axis=-1)


@pytest.mark.parametrize(
    "target", [[0.22, 0.0, 0.54], [0.1, 0.15, 0.55], [-0.2, 0.1, 0.5], [0.0, 0.0, 0.6]]
)
def test_a_reachable_target_is_reached_to_a_millimeter_and_held(fine_planner, target):
    goal = Goal.of(3, change_weight=0.0).with_position(target)
    distances = tip_distances(drive(fine_planner, [goal] * 100), target)
    assert distances[-30:].max() < 1e-3


def test_an_axis_is_reached_too(fine_planner):
    desired = np.array([np.sin(0.8), 0.0, np.cos(0.8)])
    goal = Goal.of(3, change_weight=0.0).with_axis(desired)
    states = np.asarray(states_of(drive(fine_planner, [goal] * 100)), np.float64)
    assert angles_between(states[-1, -1, 3:], desired) < 0.5


def test_plans_keep_the_step_limit_the_bend_limit_and_length_one(paper_planner):
    planned = drive(paper_planner, jumping_goals(1, 200))
    changes = angles_between(planned[1:], planned[:-1])
    assert 3.9 < changes.max() <= 4.0 + 0.01
    bends = angles_between(planned, np.array([0.0, 0.0, 1.0]))
    assert 46.0 < bends.max() <= 47.0 + 0.01
    np.testing.assert_allclose(np.linalg.norm(planned, axis=-1), 1.0, atol=1e-6)


@pytest.mark.parametrize(
    "target", [[2.0, 0.0, 0.3], [0.0, 0.0, 2.0], [1.2, -1.6, 0.0], [0.0, 0.0, -2.0]]
)
def test_a_target_two_meters_away_does_not_excite_the_arm(paper_planner, target):
    planned = drive(paper_planner, [Goal.of(3).with_position(target)] * 100)
    assert np.isfinite(planned).all()
    distances = tip_distances(planned, target)
    assert distances[-1] <= distances[0] + 1e-6
    assert np.ptp(states_of(planned)[-30:, -1, :3], axis=0).max() < 0.03


def test_the_same_goals_make_the_same_plan(paper_planner):
    one, other = (drive(paper_planner, jumping_goals(3, 40)) for _ in range(2))
    np.testing.assert_array_equal(one, other)


@pytest.mark.slow
def test_free_vectors_keep_the_step_limit_but_not_the_sphere():
    planner = planner_of(2, on_sphere=False)
    start = 0.7 * straight(2)
    planned = drive(planner, jumping_goals(4, 60, modules=2), start)
    assert np.isfinite(planned).all()
    assert np.ptp(np.linalg.norm(planned, axis=-1)) > 0.01
    steps = np.linalg.norm(np.diff(planned, axis=0), axis=-1)
    assert steps.max() <= np.deg2rad(4.0) + 1e-6


class SummingModel(ForwardModel):
    """A model whose memory is the sum of all readings."""

    scale: float = eqx.field(static=True)

    def start(self, sensed):
        return self.scale * jnp.sum(sensed)

    def observe(self, sensed, memory):
        return memory + jnp.sum(sensed)

    def predict(self, configurations, memory, disturbances=None):
        return jnp.concatenate([configurations + memory, configurations], axis=-1)

    def for_planning(self):
        return self


def test_the_forward_model_observes_every_reading_and_the_plan_holds_its_memory():
    planner = Planner(an_arm(1), SummingModel(scale=100.0), PAPER)
    readings = np.array([[[0.01, 0.0, 0.0]], [[0.0, 2.0, 0.0]], [[0.0, 0.0, 3.0]]])
    plan = planner.start(Estimate(readings[0]))
    assert float(plan.memory) == pytest.approx(1.0)
    for reading in readings[1:]:
        plan = planner.plan(plan, Estimate(reading), Goal.of(1))
    assert float(plan.memory) == pytest.approx(6.0)


def test_the_plan_takes_the_hysteresis_of_the_estimate_and_advances_none():
    planner = Planner(an_arm(1), SummingModel(scale=100.0), PAPER)
    estimate = Estimate(np.array([[0.0, 2.0, 0.0]]), hysteresis=np.float32(7.0))
    plan = planner.start(estimate)
    assert float(plan.memory) == 7.0
    plan = planner.plan(plan, estimate._replace(hysteresis=np.float32(8.0)), Goal.of(1))
    assert float(plan.memory) == 8.0


@pytest.mark.parametrize("invalid", [np.nan, np.inf])
def test_a_reading_that_is_not_finite_never_enters_the_memory(invalid):
    planner = Planner(an_arm(1), SummingModel(scale=100.0), PAPER)
    sound = np.array([[0.01, 0.0, 0.02]])
    goal = Goal.of(1).with_position([0.5, 0.0, 0.5])
    observed = planner.plan(planner.start(Estimate(sound)), Estimate(sound), goal)
    ignored = planner.plan(observed, Estimate(np.full((1, 3), invalid)), goal)
    assert float(ignored.memory) == float(observed.memory)
    assert not np.array_equal(ignored.configurations, observed.configurations)
    again = planner.plan(ignored, Estimate(sound), goal)
    assert float(again.memory) == pytest.approx(float(observed.memory) + 0.03)
    with pytest.raises(TargetError, match="not finite"):
        planner.start(Estimate(np.full((1, 3), invalid)))
