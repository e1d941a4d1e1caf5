"""The second day: an arm that has changed since its training, and a session of 50 s.

Changes of known size show what a session is worth; drawn ones, whether the deviations
that it states are true.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from s2c2a import data, jobs, strategies
from s2c2a.arm import ArmGeometry, ArmSpec, save_arm
from s2c2a.evaluation import Row, describe_disagreement
from s2c2a.models import ForwardOptions
from s2c2a.models.session import DayChange, rotated
from s2c2a.models.session_fit import CABLE, ROTATION, SOFTNESS, TRANSLATION
from s2c2a.robots import RobotFactory
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.spaces import AXIS, POSITION, Actions, States
from s2c2a.strategies import Session, TrainedNetworks
from s2c2a_experiments.run_rows import labeled

EXPERIMENT = "session"
OTHER_DAY = "s2c2a_experiments.session:OtherDay"
SECONDS = 50.0  # of a session
SHIFT = 8e-3  # m
TURN = float(np.deg2rad(3.0))
HOMING = 1e-3  # m, of every cable
SOFTER = 0.15  # share by which the stiffness falls
TESTED = 3  # episodes that a session is judged on
CHANGES = ("none", "frame", "homing", "stiffness", "all")
REPEATED = ("none", "all")  # on all days and from all starts; the others once


class Day(NamedTuple):
    """What differs from the day of the training.

    Attributes:
        name: of the change.
        number: seed of directions and signs.
        shift: of the tracking's frame [m].
        turn: of the tracking's frame [rad].
        homing: error of every cable's homing [m].
        softness: logarithm of the compliance of every module over that of the training.
    """

    name: str
    number: int
    shift: float = 0.0
    turn: float = 0.0
    homing: float = 0.0
    softness: tuple[float, ...] = ()

    @classmethod
    def changed(cls, change: str, number: int, arm: ArmSpec) -> "Day":
        """A day with one change of `CHANGES`."""
        sizes: dict[str, dict[str, Any]] = {
            "none": {},
            "frame": {"shift": SHIFT, "turn": TURN},
            "homing": {"homing": HOMING},
            "stiffness": {
                "softness": (-float(np.log(1.0 - SOFTER)),) * arm.module_count
            },
        }
        sizes["all"] = sizes["frame"] | sizes["homing"] | sizes["stiffness"]
        return cls(change, number, **sizes[change])

    @classmethod
    def drawn(cls, number: int, arm: ArmSpec) -> "Day":
        """A day with changes of the size that the priors of a session expect."""
        random = np.random.default_rng([number, 44])
        vectors = random.normal(size=(2, 3))
        shift, turn = np.linalg.norm(vectors, axis=-1)
        homing = abs(float(random.normal(scale=CABLE)))
        softness = random.normal(scale=SOFTNESS, size=arm.module_count)
        frame = TRANSLATION * float(shift), ROTATION * float(turn)
        return cls("drawn", number, *frame, homing, tuple(softness.tolist()))


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

    def change(self, softness: tuple[float, ...]) -> DayChange:
        """The true change since a training with motors that were homed well."""
        geometry = ArmGeometry.of(self.arm)
        wound = self._homed / geometry.cable_radii[:, None]
        offsets = np.einsum("mkn,mn->mk", geometry.bend_matrices, wound)
        parts = (self._shift, self._turn, offsets, wound.mean(axis=1), softness)
        return DayChange(*map(jnp.asarray, parts))

    def _sample_homing_errors(self) -> Actions:
        return self._homed.copy()


@dataclass(frozen=True)
class SessionStudy:
    """What is changed.

    Attributes:
        arms: that are trained.
        task: name.
        seed: of data and training.
        starts: of the runs after no change and after all.
        days: number of days of these changes.
        drawn: number of days on which stated deviations are compared with true errors.
    """

    arms: tuple[ArmSpec, ...]
    task: str = "circle"
    seed: int = 0
    starts: int = 2
    days: int = 3
    drawn: int = 14


def session_rows(
    study: SessionStudy,
    folder: Path,
    make: jobs.Make,
    keep: Callable[[list[Row]], None],
) -> list[Row]:
    """Errors of every arm on its days, after each change, and after a session.

    Args:
        study: what is changed.
        folder: for weights, recordings and arm files.
        make: finds or makes runs, networks and recordings.
        keep: saves the rows so far.
    """
    recipe = strategies.recipe_named("best")
    needed = [
        jobs.NetworksArtifact.of_recipe(arm, recipe, study.seed) for arm in study.arms
    ]
    rows: list[Row] = []
    for arm, networks in zip(study.arms, make(needed), strict=True):
        weights = folder / f"{arm.name}.safetensors"
        strategies.save_networks(networks, weights)
        measured = _TrainedArm(study, arm, networks, weights)
        for change in CHANGES:
            rows += _change_rows(measured, change, make)
            keep(rows)
        rows += _coverage_rows(measured)
        keep(rows)
    return rows


@dataclass(frozen=True)
class _TrainedArm:
    """A trained arm, whose sessions are measured.

    Attributes:
        study: what is changed.
        arm: the arm.
        networks: of its training.
        weights: their file.
    """

    study: SessionStudy
    arm: ArmSpec
    networks: TrainedNetworks
    weights: Path

    def robot(self, day: Day) -> RobotFactory:
        """The arm on a day."""
        options: dict[str, object] = {"day": day.number}
        options |= {"shift": day.shift, "turn": day.turn, "homing": day.homing}
        if day.softness:
            described = self.arm.model_dump()
            for module, softer in zip(described["modules"], day.softness, strict=True):
                mismatch = module.setdefault("mismatch", {})
                stiffness = 1.0 + mismatch.get("stiffness_error", 0.0)
                stiffness *= np.exp(-softer)
                mismatch["stiffness_error"] = float(stiffness) - 1.0
            twin = self.weights.with_suffix(f".{day.name}-{day.number}.toml")
            save_arm(ArmSpec.model_validate(described), twin, overwrite=True)
            options["twin"] = str(twin)
        return RobotFactory(OTHER_DAY, tuple(options.items()))

    def recording(self, day: Day, episodes: int = 1) -> data.Recording:
        """Episodes of 50 s on a day; other motion for other numbers of them."""
        options = replace(
            self.networks.recipe.collect_options(day.number + 100 * episodes),
            episodes=episodes,
            samples=round(SECONDS / self.arm.control_period),
        )
        path = self.weights.with_suffix(f".{episodes}.episodes")
        make_robot = partial(self.robot(day).seeded, self.arm)
        return data.collect(
            path, self.arm, make_robot, options, threads=1, overwrite=True
        )

    def model_error(self, networks: TrainedNetworks, day: Day) -> float:
        """Mean distance of the tip from the model's in other motion of a day [m]."""
        options = networks.recipe.c2s
        tested = self.recording(day, TESTED)
        known = strategies.training_data(tested, networks.recipe)
        # that of the base class: options of the recipe would look for the chain within
        predicted = ForwardOptions.predictions(options, networks.c2s, known)
        errors = (predicted - known.states)[:, :, -1, POSITION]
        return float(np.linalg.norm(errors, axis=-1).mean())


def _change_rows(measured: _TrainedArm, change: str, make: jobs.Make) -> Iterator[Row]:
    """Scores, model errors and warnings after a change, without and with a session."""
    study = measured.study
    networks = measured.networks
    is_repeated = change in REPEATED
    days = [
        Day.changed(change, study.seed + number, measured.arm)
        for number in range(study.days if is_repeated else 1)
    ]
    sessions = [
        strategies.measured_session(networks, measured.weights, measured.recording(day))
        for day in days
    ]
    improved = [float(session.improves) for session, _ in sessions]
    for label in ("without", "with"):
        used = [session if label == "with" else None for session, _ in sessions]
        starts = range(study.starts if is_repeated else 1)
        runs = make(
            [
                _job(measured, day, session, study.seed + start)
                for day, session in zip(days, used, strict=True)
                for start in starts
            ]
        )
        name = f"{change}, {label} session"
        yield from labeled(jobs.score_rows(EXPERIMENT, runs), name)
        heading = jobs.Heading.of(EXPERIMENT, runs)
        errors = [
            1000 * measured.model_error(strategies.with_session(networks, session), day)
            for day, session in zip(days, used, strict=True)
        ]
        yield heading.row("babbling", name, "model error", "mm", errors)
        warned = [float(bool(describe_disagreement(run.episode))) for run in runs]
        yield heading.row(study.task, name, "warns", "of runs", warned)
    yield heading.row("babbling", name, "improves", "of sessions", improved)


def _job(
    measured: _TrainedArm, day: Day, session: Session | None, start: int
) -> jobs.Job:
    arm = measured.arm
    given = jobs.GivenNetworks.read(measured.weights, arm, session=session)
    conditions = jobs.Conditions(measured.robot(day))
    return jobs.jobs_for(
        [measured.study.task], arm, ["s2c2a"], [start], given.recipe, conditions, given
    )[0]


def _coverage_rows(measured: _TrainedArm) -> Iterator[Row]:
    """How often the true change is within two stated deviations, by its parts."""
    study = measured.study
    arm = measured.arm
    within: dict[str, list[float]] = {}
    for number in range(study.drawn):
        day = Day.drawn(study.seed + number, arm)
        _, fit = strategies.measured_session(
            measured.networks, measured.weights, measured.recording(day)
        )
        robot = measured.robot(day).make(arm)
        assert isinstance(robot, OtherDay)
        found = fit.posterior.change
        std = fit.posterior.std
        for part, true in vars(robot.change(day.softness)).items():
            estimated = np.asarray(getattr(found, part))
            error = np.abs(estimated - np.asarray(true))
            is_within = error <= 2.0 * np.asarray(getattr(std, part))
            within.setdefault(part, []).append(float(is_within.mean()))
    recipe = measured.networks.recipe.name
    heading = jobs.Heading(EXPERIMENT, arm, recipe, (study.seed,), OTHER_DAY)
    for part, shares in within.items():
        name = "drawn days"
        yield heading.row(
            "babbling", name, f"{part} within two std", "of numbers", shares
        )
