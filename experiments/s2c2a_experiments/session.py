"""The second day: an arm that has changed since its training, and a session of 50 s."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from s2c2a import data, jobs, strategies
from s2c2a.arm import ArmSpec, save_arm
from s2c2a.evaluation import Row, describe_disagreement
from s2c2a.models import ForwardOptions
from s2c2a.models.session import rotated
from s2c2a.robots import RobotFactory
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.spaces import AXIS, POSITION, Actions, States
from s2c2a.strategies import Session, TrainedNetworks
from s2c2a_experiments.run_rows import labeled

EXPERIMENT = "session"
SECONDS = 50.0  # of a session
SHIFT = 8e-3  # m
TURN = np.deg2rad(3.0)
HOMING = 1e-3  # m, of every cable
SOFTER = 0.15  # share by which the stiffness falls
TESTED = 3  # episodes that a session is judged on
CHANGES = ("none", "frame", "homing", "stiffness", "all")


class OtherDay(SimulatedRobot):
    """The simulated arm on a day: homed once, with a tracking that was put up anew.

    Args:
        arm: description of the arm.
        seed: of noise.
        jitter: see `SimulatedRobot`.
        center_line: see `SimulatedRobot`.
        twin: arm file of the present mechanics.
        day: seed of what is drawn for the day.
        shift: of the tracking's frame [m].
        turn: of the tracking's frame [rad].
        homing: error of every cable's homing [m], in a random direction.
    """

    def __init__(
        self,
        arm: ArmSpec,
        seed: int = 0,
        jitter: float = 0.0,
        center_line: bool = False,
        twin: str = "",
        day: int = 0,
        shift: float = 0.0,
        turn: float = 0.0,
        homing: float = 0.0,
    ):
        random = np.random.default_rng([day, 43])
        directions = random.normal(size=(2, 3))
        directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
        self._shift = shift * directions[0]
        self._turn = turn * directions[1]
        shape = (arm.module_count, arm.cable_count)
        own = random.normal(scale=arm.motor.homing_error, size=shape)
        self._homed = own + homing * random.choice([-1.0, 1.0], shape)
        super().__init__(
            arm, seed=seed, jitter=jitter, center_line=center_line, twin=twin
        )

    def states(self) -> States:
        """States in the present frame of the tracking."""
        states = super().states()
        turn = jnp.asarray(self._turn)
        positions = np.asarray(rotated(jnp.asarray(states[:, POSITION]), turn))
        axes = np.asarray(rotated(jnp.asarray(states[:, AXIS]), turn))
        return np.concatenate([positions + self._shift, axes], axis=-1)

    def _sample_homing_errors(self) -> Actions:
        return self._homed.copy()


@dataclass(frozen=True)
class SessionStudy:
    """What is changed.

    Attributes:
        arms: that are trained.
        task: name.
        seed: of data, training and start.
        folder: for weights, recordings and arm files.
    """

    arms: tuple[ArmSpec, ...]
    task: str
    seed: int
    folder: Path


def session_rows(study: SessionStudy, make: jobs.Make) -> list[Row]:
    """Errors of every arm on its day, after each change, and after a session.

    Args:
        study: what is changed.
        make: finds or makes runs, networks and recordings.
    """
    recipe = strategies.recipe_named("best")
    needed = [
        jobs.NetworksArtifact.of_recipe(arm, recipe, study.seed) for arm in study.arms
    ]
    rows: list[Row] = []
    for arm, networks in zip(study.arms, make(needed), strict=True):
        rows += _arm_rows(study, arm, networks, make)
    return rows


def _arm_rows(
    study: SessionStudy, arm: ArmSpec, networks: TrainedNetworks, make: jobs.Make
) -> Iterator[Row]:
    weights = study.folder / f"{arm.name}.safetensors"
    strategies.save_networks(networks, weights)
    for change in CHANGES:
        robot = _robot(study, arm, change)
        moved = _recording(study, arm, networks, robot, change, 1)
        tested = _recording(study, arm, networks, robot, change, TESTED)
        session, _ = strategies.measured_session(networks, weights, moved)
        adapted = strategies.with_session(networks, session)
        runs = make(
            [_job(study, arm, weights, robot, used) for used in (None, session)]
        )
        for label, used, run in zip(
            ("without", "with"), (networks, adapted), runs, strict=True
        ):
            name = f"{change}, {label} session"
            yield from labeled(jobs.score_rows(EXPERIMENT, [run]), name)
            heading = jobs.Heading.of(EXPERIMENT, [run])
            # mean distance of the tip from the model's [m]
            options = used.recipe.c2s
            known = strategies.training_data(tested, used.recipe)
            # that of the base class: options of the recipe would look for the chain within
            predicted = ForwardOptions.predictions(options, used.c2s, known)
            errors = (predicted - known.states)[:, :, -1, POSITION]
            tip_error = float(np.linalg.norm(errors, axis=-1).mean())
            error = 1000 * tip_error
            yield heading.row("babbling", name, "model error", "mm", [error])
            warned = float(bool(describe_disagreement(run.episode)))
            yield heading.row(study.task, name, "warns", "of runs", [warned])


def _job(
    study: SessionStudy,
    arm: ArmSpec,
    weights: Path,
    robot: RobotFactory,
    session: Session | None,
) -> jobs.Job:
    given = jobs.GivenNetworks.read(weights, arm, session=session)
    conditions = jobs.Conditions(robot)
    return jobs.jobs_for(
        [study.task], arm, ["s2c2a"], [study.seed], given.recipe, conditions, given
    )[0]


def _robot(study: SessionStudy, arm: ArmSpec, change: str) -> RobotFactory:
    """The arm on the day of a change."""
    options: dict[str, object] = {"day": study.seed + CHANGES.index(change)}
    if change in ("frame", "all"):
        options |= {"shift": SHIFT, "turn": TURN}
    if change in ("homing", "all"):
        options |= {"homing": HOMING}
    if change in ("stiffness", "all"):
        twin = study.folder / f"{arm.name}.toml"
        described = arm.model_dump()
        for module in described["modules"]:
            mismatch = module["mismatch"]
            stiffness = 1.0 + mismatch["stiffness_error"]
            mismatch["stiffness_error"] = stiffness * (1.0 - SOFTER) - 1.0
        save_arm(ArmSpec.model_validate(described), twin, overwrite=True)
        options |= {"twin": str(twin)}
    return RobotFactory("s2c2a_experiments.session:OtherDay", tuple(options.items()))


def _recording(
    study: SessionStudy,
    arm: ArmSpec,
    networks: TrainedNetworks,
    robot: RobotFactory,
    change: str,
    episodes: int,
) -> data.Recording:
    """Episodes of 50 s on the day of a change; other motion for other numbers of them."""
    options = replace(
        networks.recipe.collect_options(study.seed + 100 * episodes),
        episodes=episodes,
        samples=round(SECONDS / arm.control_period),
    )
    path = study.folder / f"{arm.name}-{change}-{episodes}.episodes"
    make_robot = partial(robot.seeded, arm)
    return data.collect(path, arm, make_robot, options, threads=1, overwrite=True)
