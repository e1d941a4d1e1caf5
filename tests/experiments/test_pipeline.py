"""Small versions of the project's claims: one seed, fewer epochs, same thresholds."""

import operator
from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.arm import ArmSpec
from s2c2a.control import NetworkController
from s2c2a.estimation import configuration_map_for
from s2c2a.evaluation import angles_deg
from s2c2a.execution.compilation import compiled
from s2c2a.jobs import jobs_for, make_all, score_rows
from s2c2a.planning import PAPER, Goal
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.spaces import Reading
from s2c2a.strategies import TrainedNetworks, pcc_strategy
from s2c2a.tasks.circle import APPROACH_TIME, circle_path


@pytest.mark.slow
def test_on_the_twin_s2c2a_beats_pcc_and_what_pcc_can_be_fitted_to(
    trained, given, cache
):
    weights = given(trained["twin_arm"])
    names = ["s2c2a", "pcc", "pcc-fitted"]
    arm, recipe = weights.arm, weights.recipe
    jobs = jobs_for(["circle"], arm, names, [0], recipe, weights=weights)
    runs = make_all(jobs, cache)
    assert all((run.episode.ran("tick_time") > 0).all() for run in runs)
    rows = score_rows("circle", runs)
    assert {(row.metric, row.unit) for row in rows} == {("position", "cm")}
    errors = {row.strategy: row.mean for row in rows}
    assert errors["s2c2a"] <= 1.0
    assert errors["s2c2a"] < errors["pcc"]
    assert errors["s2c2a"] < errors["pcc-fitted"]


@pytest.mark.parametrize("name", ["twin_arm", "simulated_arm"])
def test_the_controller_learns_to_the_papers_held_out_error(name, trained):
    assert trained[name].trained["C2A"].percent[0] <= 0.91


@pytest.mark.slow
def test_the_twins_forward_model_errs_as_the_papers(trained_as_the_paper):
    percent = trained_as_the_paper.trained["C2S"].percent[0]
    assert percent == pytest.approx(1.93, rel=0.3)


@pytest.mark.parametrize("name", ["twin_arm", "simulated_arm"])
def test_the_forward_model_errs_by_less_than_one_percent(name, trained):
    assert trained[name].trained["C2S"].percent[0] <= 1.0


def track_reference(networks: TrainedNetworks, speed: float, steps: int) -> np.ndarray:
    """Angles [deg] while C2A alone follows what was sensed while PCC drove the circle."""
    arm = networks.arm
    controller = NetworkController(networks.c2a)
    sensed_arm = networks.recipe.seen_arm(arm)  # the sensing that the networks know
    sense = _configuration_sensor(sensed_arm)
    act = compiled(NetworkController.act, controller)
    errors = []
    references = recorded_reference(sensed_arm, speed, networks.seed, steps)
    with SimulatedRobot(arm, seed=networks.seed + 1) as robot:
        sensed = sense(robot.read())
        memory = controller.start(jnp.asarray(sensed))
        for desired in references:
            action, memory = act(desired, sensed, memory)
            robot.step(np.asarray(action, dtype=np.float64))
            sensed = sense(robot.read())
            errors.append(angles_deg(sensed, desired))
    return np.array(errors)


def recorded_reference(arm: ArmSpec, speed: float, seed: int, steps: int) -> np.ndarray:
    """Sensed configurations while `pcc` drives round after round of the circle."""
    rate = arm.control_rate / speed
    path = circle_path(arm.length, rate)
    one_round = path[round(APPROACH_TIME * rate) :]
    repetitions = [one_round] * (steps // len(one_round))
    path = np.concatenate([path, *repetitions])
    strategy = pcc_strategy(arm, PAPER)
    sense = _configuration_sensor(arm)
    sensed = []
    with SimulatedRobot(arm, seed=seed) as robot:
        strategy.start(robot.read())
        for position in path[:steps]:
            goal = Goal.of(arm.module_count).with_position(position)
            robot.step(strategy.step(robot.read(), goal))
            sensed.append(sense(robot.read()))
    return np.array(sensed)


def _configuration_sensor(arm: ArmSpec) -> Callable[[Reading], np.ndarray]:
    """A compiled function from readings to sensed configurations."""
    estimator = configuration_map_for(arm)
    estimate = compiled(operator.call, estimator)
    return lambda reading: np.asarray(estimate(estimator.inputs(reading)))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["twin_arm", "simulated_arm"])
@pytest.mark.parametrize("speed", [0.2, 1.0, 2.0])
def test_the_controller_tracks_unseen_references_without_diverging(
    name, speed, trained
):
    errors = track_reference(trained[name], speed, steps=400)
    assert errors.mean() <= 1.5
    assert errors[-100:].mean() <= 1.5 * max(errors[:100].mean(), 0.2)
