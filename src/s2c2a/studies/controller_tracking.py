"""C2A on its own, in closed loop, on references that it has not seen: a low held-out error proves nothing."""

import operator
from collections.abc import Sequence
from dataclasses import dataclass

import jax
import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.control import NetworkController
from s2c2a.evaluation.metrics import angles_deg
from s2c2a.evaluation.report import Row
from s2c2a.jobs import Heading, Make, NetworksArtifact
from s2c2a.models import C2A
from s2c2a.planning import PAPER, Goal
from s2c2a.programs import compiled
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.sensing import estimator_for
from s2c2a.spaces import Reading
from s2c2a.strategies import Recipe, TrainedNetworks, pcc_strategy
from s2c2a.tasks.circle import APPROACH_TIME, circle_path

SPEEDS = (0.2, 1.0, 2.0)
"""Of the circle, as parts of its own speed."""
STEPS = 1000


@dataclass(frozen=True)
class Tracking:
    """How C2A followed one reference: angle between wanted and sensed configuration, shape (steps, modules) [deg]."""

    speed: float
    errors: Float[np.ndarray, "steps modules"]


def tracking_table(
    arms: Sequence[ArmSpec], seeds: Sequence[int], make: Make, recipe: Recipe
) -> tuple[list[Row], list[float]]:
    """Rows of every arm and speed, and for each the mean of the last 200 steps of the worst seed [deg]."""
    rows, ends = [], []
    for arm in arms:
        trained = make([NetworksArtifact(arm, recipe, seed) for seed in seeds])
        tracked = [[track_circle(networks, speed, networks.seed) for speed in SPEEDS] for networks in trained]
        rows += tracking_rows(tracked, trained)
        ends += [max(float(one.errors[-200:].mean()) for one in alike) for alike in zip(*tracked, strict=True)]
    return rows, ends


def track_circle(networks: TrainedNetworks, speed: float, seed: int, steps: int = STEPS) -> Tracking:
    """Record what the sensors say while inverse PCC drives the arm along the circle, then let C2A do it again."""
    wanted = recorded_reference(networks.arm, speed, seed, steps)
    return Tracking(speed, drive(networks.arm, networks.c2a, wanted, seed))


def recorded_reference(arm: ArmSpec, speed: float, seed: int, steps: int) -> Float[np.ndarray, "steps modules 3"]:
    """Sensed configurations after every step of `pcc` on the circle at a part of its speed, round after round."""
    path = circle_path(arm.length, arm.control_rate / speed)
    rounds = path[round(APPROACH_TIME * arm.control_rate / speed) :]
    while len(path) < steps:
        path = np.concatenate([path, rounds])
    strategy, sense = pcc_strategy(arm, PAPER), _sense(arm)
    sensed = []
    with SimulatedRobot(arm, seed=seed) as robot:
        strategy.start(robot.read())
        for position in path[:steps]:
            goal = Goal.of(arm.module_count).with_position(position)
            robot.step(strategy.step(robot.read(), goal))
            sensed.append(sense(robot.read()))
    return np.array(sensed)


def drive(
    arm: ArmSpec, network: C2A, wanted: Float[np.ndarray, "steps modules 3"], seed: int
) -> Float[np.ndarray, "steps modules"]:
    """Let C2A alone follow wanted configurations from rest; returns the errors [deg] of every step and module."""
    controller, sense = NetworkController(network), _sense(arm)
    act = compiled(NetworkController.act, controller)
    errors = []
    with SimulatedRobot(arm, seed=seed + 1) as robot:
        sensed = sense(robot.read())
        memory = controller.start(jax.numpy.asarray(sensed))
        for configuration in wanted:
            action, memory = act(configuration, sensed, memory)
            robot.step(np.asarray(action, dtype=np.float64))
            sensed = sense(robot.read())
            errors.append(angles_deg(sensed, configuration))
    return np.array(errors)


def tracking_rows(tracked: list[list[Tracking]], networks: list[TrainedNetworks]) -> list[Row]:
    """One row a speed: mean over steps and modules [deg], from one list of trackings a seed."""
    seeds = tuple(trained.seed for trained in networks)
    heading = Heading("controller", networks[0].arm, networks[0].recipe.name, seeds)
    rows = []
    for speed, trackings in zip(SPEEDS, zip(*tracked, strict=True), strict=True):
        errors = [tracking.errors.mean(axis=-1) for tracking in trackings]
        means, spreads = [float(one.mean()) for one in errors], [float(one.std()) for one in errors]
        task = f"circle at {speed:g} of its speed"
        rows.append(heading.row(task, "C2A", "configuration error", "deg", means, spreads, **heading.modes))
    return rows


def _sense(arm: ArmSpec):
    estimator = estimator_for(arm)
    estimate = compiled(operator.call, estimator)

    def sense(reading: Reading) -> Float[np.ndarray, "modules 3"]:
        return np.asarray(estimate(estimator.inputs(reading)))

    return sense
