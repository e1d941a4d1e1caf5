"""A trained policy is a strategy: its file, and what it commands."""

from itertools import pairwise

import numpy as np
import pytest

import s2c2a
from s2c2a.arm import load_arm
from s2c2a.errors import StrategyError
from s2c2a.integrations.environments.policy import (
    PolicyDriver,
    PolicyStrategy,
    observation_size,
    save_policy,
)
from s2c2a.integrations.environments.simulation import SimulationBatch
from s2c2a.integrations.environments.spaces import Controls
from s2c2a.jobs import Cache, GivenNetworks, jobs_for, make_all
from s2c2a.planning import Goal
from s2c2a.robots.simulation import SimulatedRobot

FINGER = load_arm("planar_finger")


def random_layers(width=8, inputs=None, seed=0):
    controls = Controls.of(FINGER)
    sizes = [inputs or observation_size(controls), width, width, controls.count]
    random = np.random.default_rng(seed)
    return [
        (random.normal(size=(after, before)), random.normal(size=after))
        for before, after in pairwise(sizes)
    ]


def test_a_policy_sees_in_a_run_what_it_saw_in_training():
    layers = [(w.astype(np.float32), b.astype(np.float32)) for w, b in random_layers()]
    driver = PolicyDriver(FINGER, layers, PolicyStrategy(8))
    batch = SimulationBatch("Track", FINGER)
    batch.reset([0], [np.random.default_rng(0)], new_robots=True)
    seed = int(np.random.default_rng(0).integers(2**31))
    robot = SimulatedRobot(FINGER, seed=seed)
    reading = robot.open()
    reading = robot.read()
    driver.start(reading)
    observations = batch.observations()
    for _ in range(8):
        estimate = driver.estimate(reading, batch._commands[0])
        goal = Goal.of(2).with_position(batch.goal(0))
        action = driver.plan(estimate, goal)
        np.testing.assert_allclose(action, driver._act(observations[0]), atol=2e-4)
        observations = batch.step(action[None]).observations
        robot.step(batch._commands[0])
        reading = robot.read()


@pytest.mark.parametrize("activation", ["relu", "tanh"])
def test_a_file_keeps_the_numbers(tmp_path, activation):
    file = tmp_path / "policy.safetensors"
    layers = random_layers()
    save_policy(file, FINGER, layers, activation, squashed=False)
    options = PolicyStrategy(8, 2, activation, squashed=False)
    given = PolicyDriver(FINGER, layers, options)
    values = np.linspace(-1, 1, observation_size(Controls.of(FINGER)))
    read = s2c2a.load_strategy(file)
    np.testing.assert_allclose(read._act(values), given._act(values), atol=1e-5)


def test_a_policy_may_be_linear(tmp_path):
    weight = np.ones((Controls.of(FINGER).count, observation_size(Controls.of(FINGER))))
    save_policy(tmp_path / "linear.safetensors", FINGER, [(weight, weight[:, 0])])
    driver = s2c2a.load_strategy(tmp_path / "linear.safetensors")
    values = np.linspace(-0.1, 0.1, weight.shape[1])
    expected = np.tanh(weight @ values + 1.0)
    np.testing.assert_allclose(driver._act(values), expected, atol=1e-5)


@pytest.mark.slow
def test_the_runs_of_a_command_use_the_options_of_the_file(tmp_path):
    file = tmp_path / "policy.safetensors"
    save_policy(file, FINGER, random_layers(), "tanh", squashed=False)
    given = GivenNetworks.read(file, FINGER)
    jobs = jobs_for(["circle"], FINGER, ["policy"], [0], given.recipe, weights=given)
    run = make_all(jobs, Cache(tmp_path, tmp_path))[0]
    driver = s2c2a.load_strategy(file)
    expected = s2c2a.run(jobs[0].robot(), driver, jobs[0].weighted_task)
    np.testing.assert_allclose(
        run.episode.columns["actions"], expected.columns["actions"], atol=1e-9
    )


def test_a_policy_without_a_goal_stands_still():
    driver = PolicyDriver(FINGER, random_layers(), PolicyStrategy(8))
    reading = SimulatedRobot(FINGER).open()
    driver.start(reading)
    assert not driver.plan(reading, Goal.of(2)).any()


def test_layers_for_another_arm_are_refused_and_an_existing_file_stays(tmp_path):
    file = tmp_path / "policy.safetensors"
    with pytest.raises(StrategyError, match="this arm needs"):
        save_policy(file, FINGER, random_layers(inputs=7))
    with pytest.raises(
        StrategyError, match="'elu' was given; choose one of relu, tanh"
    ):
        save_policy(file, FINGER, random_layers(), "elu")
    save_policy(file, FINGER, random_layers())
    with pytest.raises(StrategyError, match="exists"):
        save_policy(file, FINGER, random_layers())
