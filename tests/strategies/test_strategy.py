"""Complete strategies: closed loop, memory, and no compilation after construction."""

import logging
from contextlib import suppress
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.arm import ArmGeometry
from s2c2a.control import InversePCC
from s2c2a.data import CollectOptions, Recording
from s2c2a.errors import RecordingError, S2C2AError, StrategyError
from s2c2a.estimation import EncoderEstimator, EncoderMap, configuration_map_for
from s2c2a.kinematics import PCC, states_from_configurations
from s2c2a.models.forward_model import PCCForwardModel
from s2c2a.planning import PAPER, Adam, Goal, Planner
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.spaces import Reading
from s2c2a.strategies import (
    Strategy,
    pcc_strategy,
    recipe_named,
    s2c2a_strategy,
    train_networks,
    train_s2c2a,
)

from marks import slow_after

REST = Goal.of(3)


@pytest.fixture(scope="module")
def trained(tiny_networks, tiny_recipe):
    """The strategy of the paper with tiny networks."""
    return s2c2a_strategy(tiny_networks)


@pytest.fixture(scope="module")
def best(tiny_best_networks):
    """The strategy of the recipe `best` with tiny networks."""
    return s2c2a_strategy(tiny_best_networks)


@pytest.fixture(params=["trained", "best"])
def either(request):
    """A trained strategy of either recipe."""
    return request.getfixturevalue(request.param)


@pytest.fixture(scope="module")
def simulated_pcc(simulated):
    """PCC for the arm that sensors its true configuration."""
    return pcc_strategy(simulated, PAPER)


def moving_goals(steps: int = 20) -> list[Goal]:
    """Goals that change in everything that may change from step to step."""
    goals = []
    for step in range(steps):
        goal = Goal.of(3, change_weight=0.1 * step).with_position(
            [0.01 * step, 0.0, 0.5], weight=step
        )
        goal = goal.with_axis([0.1, step, 1.0], weight=0.3, module=step % 3)
        goals.append(
            goal.with_obstacles(
                np.full((step % 3, 3), 0.3), np.full(step % 3, 0.1), weight=step
            )
        )
    return [*goals, REST]


def live(strategy, arm, goals, watched=True) -> np.ndarray:
    """Actions of a live session."""
    robot = SimulatedRobot(arm)
    actions, reading = [], robot.open()

    def seen(reading):
        cables = Reading(reading.time, {"cables": reading["cables"]})
        return reading if watched else cables

    strategy.start(seen(reading))
    for goal in goals:
        actions.append(robot.step(strategy.step(seen(robot.read()), goal)))
        strategy.diagnostics()
    return np.array(actions)


def changed(recording, **columns) -> Recording:
    """The recording with other columns in every episode; None leaves one out."""

    def one(episode):
        every = {**episode.columns, **columns}
        known = {name: values for name, values in every.items() if values is not None}
        return replace(episode, columns=known)

    return replace(recording, episodes=tuple(map(one, recording.episodes)))


@pytest.fixture
def compilations(caplog):
    """What JAX compiles inside a `with`; other loggers' words are left out."""

    def messages() -> list[str]:
        return [
            record.getMessage()
            for record in caplog.records
            if record.name.startswith("jax")
        ]

    with caplog.at_level(logging.WARNING), jax.log_compiles(True):
        yield messages


@pytest.mark.parametrize(
    ("strategy", "arm", "watched"),
    slow_after(
        1,
        [
            ("best", "twin", True),
            ("best", "twin", False),
            ("trained", "twin", True),
            ("trained", "twin", False),
            ("simulated_pcc", "simulated", True),
        ],
    ),
)
def test_nothing_compiles_after_a_strategy_is_built(
    strategy, arm, watched, request, compilations
):
    built, robot = request.getfixturevalue(strategy), request.getfixturevalue(arm)
    before = len(compilations())
    live(built, robot, moving_goals(), watched)
    live(built, robot, moving_goals(3), watched)
    assert compilations()[before:] == []


class SummingModel(PCCForwardModel):
    """A forward model whose memory is the sum of all sensed configurations."""

    def start(self, sensed):
        return sensed

    def observe(self, sensed, memory):
        return memory + sensed


# the planner sees what an estimator does that follows no hysteresis
@pytest.mark.slow
@pytest.mark.parametrize("estimator_follows", [True, False])
def test_every_reading_advances_the_hysteresis_once(twin, estimator_follows):
    pcc = PCC.of(twin)
    model = SummingModel.of(twin)
    configurations = EncoderMap(pcc)
    strategy = Strategy(
        "summing",
        twin,
        EncoderEstimator(configurations, model if estimator_follows else None),
        Planner(twin, model, PAPER),
        InversePCC(pcc, jnp.ones(3)),
    )
    readings = [
        Reading(0.1 * step, {"cables": 1e-3 * step * np.eye(3)}) for step in range(5)
    ]
    strategy.start(readings[0])
    for reading in readings[1:]:
        estimate = strategy.estimate(reading, np.zeros((3, 3)))
        plan = strategy.plan(estimate, Goal.of(3).with_position([0.15, 0.0, 0.55]))
    sensed = [configurations.configurations(reading) for reading in readings]
    np.testing.assert_allclose(plan.memory, np.sum(sensed, axis=0), atol=1e-5)


def test_the_count_of_compilations_does_count(compilations):
    before = len(compilations())
    jax.jit(lambda value: 3 * value + 1)(np.float32(2))
    assert len(compilations()) > before


def test_a_trained_strategy_drives_the_arm_within_its_limits(either, twin):
    geometry = ArmGeometry.of(twin)
    actions = live(either, twin, [Goal.of(3).with_position([0.15, 0.0, 0.55])] * 30)
    assert np.isfinite(actions).all()
    assert np.all((actions >= geometry.action_low) & (actions <= geometry.action_high))
    assert np.ptp(actions, axis=0).max() > 1e-4


def test_readings_that_are_no_numbers_are_refused_and_leave_no_trace(either, twin):
    good = [
        Reading(0.1 * step, {"cables": np.full((3, 3), 1e-3 * step)})
        for step in range(3)
    ]
    bad = Reading(0.1, {"cables": np.full((3, 3), np.nan)})

    def driven(with_a_bad_one):
        either.start(good[0])
        either.step(good[1], Goal.of(3).with_position([0.1, 0.0, 0.55]))
        if with_a_bad_one:
            with pytest.raises(StrategyError, match="no finite numbers"):
                either.step(bad, Goal.of(3))
        return either.step(good[2], Goal.of(3).with_position([0.1, 0.0, 0.55]))

    np.testing.assert_array_equal(driven(True), driven(False))
    with pytest.raises(StrategyError, match="no finite numbers"):
        either.start(bad)


def test_a_run_does_not_depend_on_the_runs_before_it(either, twin):
    goals = [Goal.of(3).with_position([0.15, 0.05, 0.5])] * 10
    first = live(either, twin, goals)
    live(either, twin, [Goal.of(3).with_position([-0.3, 0.0, 0.4])] * 7)
    np.testing.assert_array_equal(live(either, twin, goals), first)


def test_what_was_sensed_is_what_the_encoders_say_not_what_is_true(either, twin):
    robot = SimulatedRobot(twin)
    either.start(robot.open())
    for _ in range(8):
        robot.step(np.array([-0.6, 0.3, 0.3]) * ArmGeometry.of(twin).action_high)
    reading = robot.read()
    either.step(reading, REST)
    np.testing.assert_allclose(
        either.diagnostics()["sensed"],
        configuration_map_for(twin)(reading.sensors),
        atol=1e-6,
    )
    errors = either.diagnostics()["sensed"] - reading["configurations"]
    assert np.linalg.norm(errors, axis=-1).max() > 0.02


def test_a_controller_that_is_told_what_was_really_sent_remembers_that(trained, twin):
    """Its history holds the action that a limit let through, as if it had asked for it."""
    reading = SimulatedRobot(twin).open()
    goal = Goal.of(3).with_position([0.1, 0.0, 0.55])
    after = []
    for told in (False, True, True):
        trained.start(reading)
        trained.step(reading, goal)
        if told:
            trained.sent(0.5 * ArmGeometry.of(twin).action_high)
        after.append(trained.step(reading, goal))
    assert np.abs(after[0] - after[1]).max() > 1e-6
    np.testing.assert_array_equal(after[1], after[2])


@pytest.mark.parametrize(
    ("name", "watched"),
    [("trained", {}), ("best", {"horizon": (12, 3)})],
)
def test_what_is_told_of_a_step_has_the_columns_of_an_episode(
    name, watched, twin, request
):
    either = request.getfixturevalue(name)
    reading = SimulatedRobot(twin).open()
    either.start(reading)
    either.step(reading, REST)
    told = {name: values.shape for name, values in either.diagnostics().items()}
    columns = {
        "sensed": (3, 3),
        "planned": (3, 3),
        "predicted": (3, 6),
        "predictive_std": (3,),
        "extrapolation": (),
        "outcome": (),
        "plan_error": (),
    }
    assert told == columns | watched


def test_a_strategy_that_was_not_started_says_so(tiny_networks, twin):
    fresh, reading = s2c2a_strategy(tiny_networks), SimulatedRobot(twin).open()
    with pytest.raises(StrategyError, match="not started"):
        fresh.step(reading, REST)
    with pytest.raises(StrategyError, match="not started"):
        fresh.diagnostics()


def test_the_row_of_a_missing_configuration_is_named(recording, tiny_recipe):
    cables = recording.episodes[0].sensor("cables").copy()
    cables[6, 1, 2] = np.nan
    damaged = changed(recording, **{"sensor.cables": cables})
    with pytest.raises(RecordingError, match="in 6 rows, first in row 7 of episode 1;"):
        train_s2c2a(damaged, tiny_recipe, seed=0)


@pytest.mark.parametrize(
    ("sensor", "is_there", "message"),
    [
        ("states", False, "lacks 'states'"),
        ("states", True, "lacks true states"),
        ("cables", True, "lacks sensed configurations"),
    ],
)
def test_training_without_what_it_learns_from_is_refused(
    recording, tiny_recipe, sensor, is_there, message
):
    nan = np.full_like(recording.episodes[0].sensor(sensor), np.nan)
    columns = {f"sensor.{sensor}": nan if is_there else None}
    with pytest.raises(RecordingError, match=message):
        train_s2c2a(changed(recording, **columns), tiny_recipe, seed=0)


def test_training_on_a_recording_cut_short_is_refused(recording, tiny_recipe):
    short = replace(recording, options=recording.options | {"episodes": 18})
    with pytest.raises(RecordingError, match="6 of 18 episodes"):
        train_s2c2a(short, tiny_recipe, seed=0)


@pytest.mark.parametrize("sizes", [(1, 1), (1, 20), (6, 2)])
@pytest.mark.parametrize("strategy", ["pcc-fitted", "s2c2a", "s2c2a-motor"])
def test_every_strategy_trains_on_a_tiny_recording_or_refuses_it(
    recording, tiny_best_recipe, strategy, sizes
):
    episodes, samples = sizes

    def short(episode):
        columns = {name: values[:samples] for name, values in episode.columns.items()}
        return replace(episode, columns=columns)

    tiny = tuple(map(short, recording.episodes[:episodes]))
    options = recording.options | {"episodes": episodes, "samples": samples}
    with suppress(S2C2AError):
        train_networks(
            replace(recording, options=options, episodes=tiny),
            tiny_best_recipe,
            strategy,
        )


@pytest.mark.parametrize("seed", [-1, 0.5, 2**31, 2**63])
def test_a_seed_out_of_range_is_refused(recording, tiny_recipe, seed):
    with pytest.raises(S2C2AError, match="give one from 0 to 2147483647"):
        train_s2c2a(recording, tiny_recipe, seed)


def test_a_recipe_says_how_its_data_are_collected():
    best, long = recipe_named("best"), recipe_named("best-long")
    assert long.collect_options(3) == CollectOptions(
        "coverage", 72, seed=3, speeds=best.speeds
    )
    assert replace(long, name="best", episodes=18) == best


def test_the_papers_recipe_has_the_papers_numbers():
    """Chen et al. 2025, table II and sec. III-A."""
    paper = recipe_named("paper")
    assert (paper.c2s.layers, paper.c2s.hidden) == (4, 64)
    assert (paper.c2a.layers, paper.c2a.hidden) == (2, 32)
    for fit in (paper.c2s_fit, paper.c2a_fit):
        assert (fit.learning_rate, fit.batch_size) == (1e-3, 64)
    assert paper.planner.solver == Adam(learning_rate=0.02, iterations=10)
    assert paper.planner.on_sphere is True
    assert paper.history_noise > 0


def test_trained_networks_do_not_depend_on_how_they_are_put_to_work():
    best = recipe_named("best")
    at_work = replace(
        best, name="other", planner=PAPER, integral_gain=0.0, axis_weights=()
    )
    assert at_work.training == best.training
    for change in (
        {"speeds": (0.03, 0.2)},
        {"unit_length": False},
        {"encoders_alone": False},
        {"c2s": recipe_named("paper").c2s},
    ):
        assert replace(best, **change).training != best.training


def test_what_a_plan_leads_to_is_what_the_forward_model_says(twin):
    strategy = pcc_strategy(twin, PAPER)
    with SimulatedRobot(twin) as robot:
        reading = robot.read()
        strategy.start(reading)
        strategy.step(reading, Goal.of(3).with_position([0.2, 0.0, 0.5]))
    lengths = jnp.full(3, 0.2)
    told = strategy.diagnostics()
    states = states_from_configurations(jnp.asarray(told["planned"]), lengths)
    np.testing.assert_allclose(told["predicted"], states, atol=1e-6)
