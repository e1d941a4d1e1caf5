"""The plan of a second: its linear system, goals ahead, and control rates."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from driven import MODEL, STRAIGHT, TWIN, bends_of, driven

from s2c2a.estimation import Estimate, ModalFactors
from s2c2a.goals import PREVIEW, preview_stride, previewed
from s2c2a.kinematics import bends_from_configurations, configurations_from_bends
from s2c2a.models.forward_model import ForwardModel, PCCForwardModel
from s2c2a.obstacles import HALF_EDGES
from s2c2a.planning import BEST, Goal, Horizon, Planner
from s2c2a.planning.horizon import minimum
from s2c2a.planning.motion import Approach, GoalMotion
from s2c2a.runtime.limits import arm_at
from s2c2a_experiments.planners.one_step import LeastSquares

from marks import slow_after

NOMINAL = ModalFactors.nominal()
APPROACH = Approach.of(TWIN, NOMINAL)


@pytest.mark.slow
@pytest.mark.parametrize(("knots", "size"), [(12, 6), (1, 2), (2, 4), (5, 20)])
def test_the_minimum_is_that_of_the_whole_system(knots, size):
    random = np.random.default_rng(knots)
    slopes = random.normal(size=(knots, 3, size))
    blocks = np.einsum("kri,krj->kij", slopes, slopes) + 0.1 * np.eye(size)
    gradients = random.normal(size=(knots, size))
    coupling = np.asarray(Horizon().coupling(size))
    whole = np.zeros(2 * ((knots + 2) * size,))
    for knot in range(2, knots + 2):
        places = [np.arange(size) + (knot - back) * size for back in range(3)]
        whole[np.ix_(places[0], places[0])] += blocks[knot - 2]
        together = np.concatenate(places)
        whole[np.ix_(together, together)] += coupling
    # both knots before the first one do not move
    free = whole[2 * size :, 2 * size :]
    expected = -np.linalg.solve(free, gradients.reshape(-1))
    found = minimum(*map(jnp.float32, (blocks, gradients, coupling)))
    np.testing.assert_allclose(found.reshape(-1), expected, atol=1e-4)


def towards(x: float) -> Goal:
    return Goal.of(3).with_position([x, 0.0, 0.5]).with_obstacles([[x, 1, 0]], [0.1])


@pytest.mark.parametrize(
    ("xs", "expected"),
    [
        ((0.1, 0.11, 0.12), 0.01),
        ((0.1, 0.11, 0.13), 0.01),  # the smaller of two steps
        ((0.1, 0.1, 0.13), 0.0),  # a jump is no motion
        ((0.1, 0.12, 0.11), 0.0),
        ((0.1,), 0.0),
    ],
)
def test_a_goal_without_preview_moves_on_as_it_moved(xs, expected):
    motion = GoalMotion.of(3)
    for goal in map(towards, xs):
        motion, ahead = motion.after(goal, at(xs[0]), APPROACH)
    later = xs[-1] + expected * np.arange(PREVIEW)
    np.testing.assert_allclose(ahead.positions[:, -1, 0], later, atol=1e-5)
    # an obstacle covers its way to come, and has its center in the middle of it
    half = expected * PREVIEW / 2
    np.testing.assert_allclose(ahead.obstacles[:, 0, 0], later + half, atol=1e-5)
    np.testing.assert_allclose(ahead.cores[:, 0, HALF_EDGES][:, 2], half, atol=1e-5)
    assert np.isfinite(ahead.axes).all()


def at(x: float) -> jnp.ndarray:
    """States with the tip where `towards` leads."""
    return jnp.tile(jnp.array([x, 0.0, 0.5, 0.0, 0.0, 1.0]), (3, 1))


def decay(payload: float) -> float:
    return float(np.interp(payload, APPROACH.payloads, APPROACH.decays))


def approached(xs, start=0.0, approach=APPROACH, payload=0.0) -> np.ndarray:
    """Where an approach has its goal in every step [m]."""
    motion = GoalMotion.of(3)
    found = []
    for goal in map(towards, xs):
        motion, ahead = motion.after(goal, at(start), approach, payload)
        found.append(ahead.positions[0, -1, 0])
    return np.array(found)


@pytest.mark.slow
@pytest.mark.parametrize("payload", [0.0, 0.1])
def test_a_jump_is_approached_no_faster_than_the_slowest_mode(payload):
    jump = 0.2
    way = approached([0.0] * 5 + [jump] * 40, payload=payload)
    np.testing.assert_allclose(way[:5], 0.0, atol=1e-6)
    assert (np.diff(way[4:20]) > 0.0).all()
    assert way.max() <= jump
    # a critically damped system of third order
    t = decay(payload) * np.arange(1, 41)
    expected = jump * (1.0 - np.exp(-t) * (1.0 + t + t**2 / 2.0))
    np.testing.assert_allclose(way[5:], expected, atol=1e-5)
    assert decay(0.1) < decay(0.0)


def test_an_arm_approaches_its_first_goal_and_follows_one_that_moves():
    assert 0.0 <= approached([0.2])[0] < 0.01
    # from goals that the arm can follow, and from a noisy one, nothing is held back
    noisy = 0.2 + 0.01 * np.random.default_rng(0).normal(size=30)
    for xs in (0.2 + 0.02 * np.sin(0.2 * np.arange(30)), noisy):
        np.testing.assert_allclose(approached(xs, start=xs[0]), xs, atol=1e-6)


@pytest.mark.parametrize("rate", slow_after(1, [10.0, 50.0, 100.0]))
def test_noise_of_a_target_is_no_jump(rate):
    approach = Approach.of(arm_at(TWIN, rate), NOMINAL)
    noise = 0.005 * np.random.default_rng(0).normal(size=200)
    motion = GoalMotion.of(3)
    for x in 0.2 + noise:
        motion, _ = motion.after(towards(x), at(0.2), approach)
        np.testing.assert_array_equal(motion.offset, 0.0)


@pytest.mark.parametrize("modules", slow_after(1, [3, 6, 10]))
def test_long_and_heavily_loaded_arms_approach_within_seconds(modules):
    arm = TWIN.model_copy(update={"modules": (*TWIN.modules[:1],) * modules})
    approach = Approach.of(arm, NOMINAL)
    assert approach.decays.min() / arm.control_period >= 0.6 * np.pi - 1e-6


def test_modules_of_very_unequal_masses_have_a_slowest_mode():
    heavy = TWIN.modules[0].model_copy(update={"mass": 10.0})
    light = TWIN.modules[0].model_copy(update={"mass": 0.0005})
    arm = TWIN.model_copy(update={"modules": (*[heavy] * 10, *[light] * 10)})
    assert np.isfinite(Approach.of(arm, NOMINAL).decays).all()


@pytest.mark.parametrize("rate", slow_after(1, [10.0, 1.0, 50.0]))
def test_a_preview_tells_the_goals_at_the_moments_of_the_horizon(rate):
    goals = [Goal.of(3).with_position([0.01 * n, 0.0, 0.5]) for n in range(100)]
    stride = preview_stride(1.0 / rate)
    assert stride == max(1, round(rate / 10.0))
    shown = list(previewed(goals, 1.0 / rate))
    numbers = np.minimum(20 + stride * np.arange(1, PREVIEW + 1) - 1, 99)
    np.testing.assert_allclose(shown[20].preview[:, -1, 0], 0.01 * numbers, atol=1e-6)
    # modules without a target have none ahead
    assert np.isnan(shown[20].preview[:, :2]).all()
    approach = Approach.of(TWIN.model_copy(update={"control_rate": rate}), NOMINAL)
    _, ahead = GoalMotion.of(3).after(shown[20], at(0.2), approach)
    np.testing.assert_allclose(ahead.positions[:, -1, 0], 0.01 * numbers, atol=1e-6)


def drive(arm, goals):
    """Bends of all plans, for an arm that follows them exactly, and the last tip."""
    plans, planned = driven(Planner(arm, PCCForwardModel.of(arm), BEST), goals)
    tip = plans[-1].expectation.states[-1, :3]
    return np.asarray(bends_of(planned))[1:], np.asarray(tip)


def test_a_plan_that_knows_of_a_step_moves_before_it():
    still, there = (Goal.of(3).with_position([x, 0.0, 0.55]) for x in (0.1, 0.2))
    goals = [still] * 60 + [there] * 5
    known, _ = drive(TWIN, previewed(goals, TWIN.control_period))
    unknown, _ = drive(TWIN, goals)
    np.testing.assert_allclose(unknown[59], unknown[58], atol=2e-3)
    assert np.abs(known[59] - known[58]).max() > 0.02


@pytest.mark.parametrize("rate", slow_after(1, [10.0, 2.0, 100.0]))
def test_a_target_is_reached_at_every_control_rate_within_the_step_limit(rate):
    limit = min(40.0 / rate, 20.0)
    arm = TWIN.model_copy(update={"control_rate": rate, "step_limit_deg": limit})
    target = np.array([0.15, 0.05, 0.55])
    goals = [Goal.of(3).with_position(target)] * max(12, round(3 * rate))
    bends, tip = drive(arm, goals)
    steps = np.linalg.norm(np.diff(bends, axis=0), axis=-1)
    assert np.linalg.norm(tip - target) < 2e-3
    assert np.rad2deg(steps.max()) <= limit + 0.01


class Lagging(ForwardModel):
    """An arm that makes a third of each step in the next one."""

    def start(self, sensed):
        return bends_from_configurations(sensed)

    def observe(self, sensed, memory):
        return bends_from_configurations(sensed)

    def predict(self, configurations, memory, disturbances=None):
        bends = (2.0 * bends_from_configurations(configurations) + memory) / 3.0
        return MODEL.predict(configurations_from_bends(bends), ())

    def for_planning(self):
        return self


@pytest.mark.slow
@pytest.mark.parametrize("rate", slow_after(1, [10.0, 50.0]))
def test_what_lags_behind_has_arrived_later_on_the_horizon(rate):
    """A plan that counts on the lag for good overshoots its target and returns."""
    limits = {"control_rate": rate, "step_limit_deg": 40.0 / rate}
    planner = Planner(TWIN.model_copy(update=limits), Lagging(), BEST)
    goal = Goal.of(3).with_position([0.1, 0.0, 0.58])
    # after 2 s the tip is within 0.3 mm; the small steps of a goal that rests go to and
    # fro until a window of 2.4 s has shown that they do not help
    _, planned = driven(planner, [goal] * round(5 * rate))
    last = np.linalg.norm(np.diff(bends_of(planned[-11:]), axis=0), axis=-1)
    assert np.rad2deg(last.max()) < 0.05


def test_an_arm_that_loses_its_target_stops():
    away = Goal.of(3).with_position([0.2, 0.0, 0.5])
    bends, _ = drive(TWIN, [away] * 4 + [Goal.of(3)] * 10)
    assert np.abs(bends[3] - bends[2]).max() > 0.02
    np.testing.assert_allclose(bends[4:], bends[3][None].repeat(10, 0), atol=1e-3)


def test_a_goal_that_is_not_finite_changes_no_plan_and_no_outcome():
    planner = Planner(TWIN, MODEL, BEST)
    plan = planner.start(Estimate(STRAIGHT))
    there = Goal.of(3).with_position([0.2, 0.0, 0.5])
    plan = planner.plan(plan, Estimate(STRAIGHT), there)
    unknown = there._replace(positions=np.full((3, 3), np.nan, np.float32))
    after = planner.plan(plan, Estimate(STRAIGHT), unknown)
    assert after.outcome is plan.outcome
    np.testing.assert_array_equal(after.configurations, plan.configurations)
    np.testing.assert_array_equal(after.motion.latest, plan.motion.latest)


@pytest.mark.slow
def test_a_plan_shows_the_tip_of_the_next_moments_and_one_step_has_none():
    goal = Goal.of(3).with_position([0.15, 0.0, 0.55])
    shown = []
    for solver in (Horizon(), LeastSquares()):
        planner = Planner(TWIN, MODEL, replace(BEST, solver=solver))
        shown.append(driven(planner, [goal] * 5)[0][-1].expectation)
    ahead, none = shown
    # the first moment is the plan itself
    np.testing.assert_allclose(ahead.horizon[0], ahead.states[-1, :3], atol=1e-6)
    distances = np.linalg.norm(ahead.horizon - goal.positions[-1], axis=-1)
    assert distances[-1] < 2e-3 < distances[0]
    assert none.horizon is None
