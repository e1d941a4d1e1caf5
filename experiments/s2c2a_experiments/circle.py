"""Closed-loop tests of C2A alone.

It follows configurations recorded while inverse PCC drives the circle.
"""

import operator
from collections.abc import Callable, Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from s2c2a import jobs
from s2c2a.arm import ArmSpec
from s2c2a.control import NetworkController
from s2c2a.estimation import configuration_map_for
from s2c2a.evaluation import Row, angles_deg
from s2c2a.execution.compilation import compiled
from s2c2a.planning import PAPER, Goal
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.spaces import Reading
from s2c2a.strategies import Recipe, TrainedNetworks, pcc_strategy
from s2c2a.tasks.circle import APPROACH_TIME, circle_path

SPEEDS = (0.2, 1.0, 2.0)
"""Speeds of the reference, as multiples of the circle task's speed."""
END_STEPS = 200  # steps whose mean error shows whether a run diverges


def controller_table(
    arms: Sequence[ArmSpec], seeds: Sequence[int], make: jobs.Make, recipe: Recipe
) -> tuple[list[Row], list[float]]:
    """Test C2A in closed loop, because a low held-out error does not show stability.

    Args:
        arms: the arms to simulate.
        seeds: of data, training and start.
        make: loads or makes networks.
        recipe: how networks are trained.

    Returns:
        Rows for every arm and speed: means over steps and modules, and spreads over
        steps [deg]; and for each row the mean of the last 200 steps of the worst seed
        [deg].
    """
    rows = []
    end_errors = []
    for arm in arms:
        trained = make(
            [jobs.NetworksArtifact.of_recipe(arm, recipe, seed) for seed in seeds]
        )
        recipe_name = trained[0].recipe.name
        used_seeds = tuple(networks.seed for networks in trained)
        heading = jobs.Heading("controller", arm, recipe_name, used_seeds)
        for speed in SPEEDS:
            errors = [track_reference(networks, speed) for networks in trained]
            end_errors.append(max(float(run[-END_STEPS:].mean()) for run in errors))
            task = f"circle at {speed:g} of its speed"
            means = [float(run.mean(axis=-1).mean()) for run in errors]
            spreads = [float(run.mean(axis=-1).std()) for run in errors]
            metric = "configuration error"
            modes = heading.modes
            row = heading.row(task, "C2A", metric, "deg", means, spreads, **modes)
            rows.append(row)
    return rows, end_errors


def track_reference(
    networks: TrainedNetworks, speed: float, steps: int = 1000
) -> Float[np.ndarray, "steps modules"]:
    """Let C2A alone follow configurations sensed while inverse PCC drove the circle.

    Args:
        networks: of the arm to simulate.
        speed: multiple of the circle task's speed.
        steps: control steps of the run.

    Returns:
        Angles between desired and sensed configurations [deg].
    """
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


def recorded_reference(
    arm: ArmSpec, speed: float, seed: int, steps: int
) -> Float[np.ndarray, "steps modules 3"]:
    """Sensed configurations while `pcc` drives round after round of the circle.

    Args:
        arm: the arm to simulate.
        speed: multiple of the circle task's speed.
        seed: of the simulated robot.
        steps: control steps to record.
    """
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
