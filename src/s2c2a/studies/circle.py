"""The circle: every strategy on both arms of the paper; and C2A on its own, in closed loop, on references from it."""

import operator
from collections.abc import Callable, Sequence
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from s2c2a import jobs
from s2c2a.arm import ArmSpec, load_arm
from s2c2a.control import NetworkController
from s2c2a.evaluation import Row, angles_deg
from s2c2a.jobs.run_folder import draw_runs, save_results
from s2c2a.planning import PAPER, Goal
from s2c2a.compilation import compiled
from s2c2a.robots import Body
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.sensing import estimator_for
from s2c2a.spaces import Reading
from s2c2a.strategies import Recipe, TrainedNetworks, pcc_strategy
from s2c2a.tasks.circle import APPROACH_TIME, circle_path

ARMS = ("twin_arm", "simulated_arm")
STRATEGIES = ("s2c2a", "pcc", "pcc-fitted")
SPEEDS = (0.2, 1.0, 2.0)
"""Of the circle, as parts of its own speed."""


def circle_table(
    folder: Path,
    seeds: Sequence[int],
    make: jobs.Make,
    recipe: Recipe,
    fidelity: str = "fast",
) -> tuple[list[Row], list[Path]]:
    """Let every strategy go round on both arms, once a seed; results and pictures go to the folder.

    Args:
        folder: the run folder.
        seeds: of data, training and start.
        make: finds or makes runs and networks.
        recipe: how networks are trained and plans made.
        fidelity: of the simulation that is driven.

    Returns:
        Its rows; and the pictures, a figure and a replay page for each arm.
    """
    arms = [load_arm(name) for name in ARMS]
    under = jobs.Conditions(Body.simulation(fidelity))
    every = jobs.in_groups(
        make,
        [
            jobs.jobs_for(["circle"], arm, STRATEGIES, seeds, recipe, under)
            for arm in arms
        ],
    )
    rows: list[Row] = []
    for arm, runs in zip(arms, every, strict=True):
        trained = make([jobs.NetworksArtifact(arm, recipe, seed) for seed in seeds])
        rows += jobs.score_rows("circle", runs) + jobs.training_rows("circle", trained)
    save_results(folder, rows, [run for runs in every for run in runs])
    return rows, [picture for runs in every for picture in draw_runs(folder, runs)]


def tracking_table(
    arms: Sequence[ArmSpec], seeds: Sequence[int], make: jobs.Make, recipe: Recipe
) -> tuple[list[Row], list[float]]:
    """Let C2A follow references alone: a low held-out error proves nothing.

    Returns:
        Rows of every arm and speed, of means over steps and modules and of spreads over
        steps [deg]; and for each the mean of the last 200 steps of the worst seed
        [deg].
    """
    rows = []
    ends = []
    for arm in arms:
        trained = make([jobs.NetworksArtifact(arm, recipe, seed) for seed in seeds])
        heading = jobs.Heading(
            "controller",
            arm,
            trained[0].recipe.name,
            tuple(one.seed for one in trained),
        )
        for speed in SPEEDS:
            errors = [track_circle(networks, speed) for networks in trained]
            ends.append(max(float(one[-200:].mean()) for one in errors))
            task = f"circle at {speed:g} of its speed"
            over_modules = [one.mean(axis=-1) for one in errors]
            means = [float(one.mean()) for one in over_modules]
            spreads = [float(one.std()) for one in over_modules]
            rows.append(
                heading.row(
                    task,
                    "C2A",
                    "configuration error",
                    "deg",
                    means,
                    spreads,
                    **heading.modes,
                )
            )
    return rows, ends


def track_circle(
    networks: TrainedNetworks, speed: float, steps: int = 1000
) -> Float[np.ndarray, "steps modules"]:
    """Record what the sensors say while inverse PCC drives the arm along the circle, then let C2A alone do it again.

    Returns:
        Angles between desired and sensed configurations [deg].
    """
    arm = networks.arm
    controller = NetworkController(networks.c2a)
    felt = networks.recipe.felt(arm)  # as its networks are
    sense = _sense(felt)
    act = compiled(NetworkController.act, controller)
    errors = []
    desired = recorded_reference(felt, speed, networks.seed, steps)
    with SimulatedRobot(arm, seed=networks.seed + 1) as robot:
        sensed = sense(robot.read())
        memory = controller.start(jnp.asarray(sensed))
        for configuration in desired:
            action, memory = act(configuration, sensed, memory)
            robot.step(np.asarray(action, dtype=np.float64))
            sensed = sense(robot.read())
            errors.append(angles_deg(sensed, configuration))
    return np.array(errors)


def recorded_reference(
    arm: ArmSpec, speed: float, seed: int, steps: int
) -> Float[np.ndarray, "steps modules 3"]:
    """Sensed configurations after every step of `pcc` on the circle at a part of its speed, round after round."""
    path = circle_path(arm.length, arm.control_rate / speed)
    rounds = path[round(APPROACH_TIME * arm.control_rate / speed) :]
    path = np.concatenate([path, *[rounds] * (steps // len(rounds))])
    strategy = pcc_strategy(arm, PAPER)
    sense = _sense(arm)
    sensed = []
    with SimulatedRobot(arm, seed=seed) as robot:
        strategy.start(robot.read())
        for position in path[:steps]:
            robot.step(
                strategy.step(
                    robot.read(), Goal.of(arm.module_count).with_position(position)
                )
            )
            sensed.append(sense(robot.read()))
    return np.array(sensed)


def _sense(arm: ArmSpec) -> Callable[[Reading], np.ndarray]:
    estimator = estimator_for(arm)
    estimate = compiled(operator.call, estimator)
    return lambda reading: np.asarray(estimate(estimator.inputs(reading)))
