"""C2A on its own, in closed loop, on references that it has not seen: a low held-out error proves nothing."""

import operator
from dataclasses import dataclass

import jax
import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.control import NetworkController
from s2c2a.evaluation.metrics import angles_deg
from s2c2a.evaluation.report import Row, over_seeds
from s2c2a.networks import C2A
from s2c2a.planning import Goal, PlannerOptions
from s2c2a.programs import compiled
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.robots.simulation.modes import first_mode
from s2c2a.sensing import estimator_for
from s2c2a.spaces import Reading
from s2c2a.strategies import TrainedNetworks, pcc_strategy
from s2c2a.tasks.circle import circle_path
from s2c2a.tasks.paths import APPROACH_TIME

SPEEDS = (0.2, 1.0, 2.0)
"""Of the circle, as parts of its own speed."""
STEPS = 1000


@dataclass(frozen=True)
class Tracking:
    """How C2A followed one reference: angle between wanted and sensed configuration, shape (steps, modules) [deg]."""

    speed: float
    errors: Float[np.ndarray, "steps modules"]


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
    strategy, sense = pcc_strategy(arm, PlannerOptions()), _sense(arm)
    sensed = []
    with SimulatedRobot(arm, seed=seed) as robot:
        strategy.start(robot.read())
        for position in path[:steps]:
            goal = Goal.of(arm.module_count).with_position(position)
            robot.send(strategy.step(robot.read(), goal))
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
            robot.send(np.asarray(action, dtype=np.float64))
            sensed = sense(robot.read())
            errors.append(angles_deg(sensed, configuration))
    return np.array(errors)


def tracking_rows(tracked: list[list[Tracking]], networks: list[TrainedNetworks]) -> list[Row]:
    """One row a speed: mean over steps and modules [deg], from one list of trackings a seed."""
    arm = networks[0].arm
    frequency, damping = first_mode(arm)
    rows = []
    for index, speed in enumerate(SPEEDS):
        errors = [trackings[index].errors.mean(axis=-1) for trackings in tracked]
        rows.append(
            Row(
                experiment="controller",
                task=f"circle at {speed:g} of its speed",
                arm=arm.name,
                fidelity="fast",
                controller="C2A",
                recipe=networks[0].recipe.name,
                metric="configuration error",
                unit="deg",
                **over_seeds([float(one.mean()) for one in errors], [float(one.std()) for one in errors]),
                seeds=tuple(trained.seed for trained in networks),
                first_mode_hz=frequency,
                damping_ratio=damping,
            )
        )
    return rows


def _sense(arm: ArmSpec):
    estimate = compiled(operator.call, estimator_for(arm))

    def sense(reading: Reading) -> Float[np.ndarray, "modules 3"]:
        truth = None if reading.configurations is None else reading.configurations.astype(np.float32)
        return np.asarray(estimate(reading.cables.astype(np.float32), truth))

    return sense
