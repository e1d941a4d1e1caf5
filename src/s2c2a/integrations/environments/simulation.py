"""The simulated arms behind the environments, which advance together."""

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from mujoco.rollout import Rollout
from numpy.typing import ArrayLike

from s2c2a.arm import ArmSpec, load_arm
from s2c2a.arm.geometry import cables_present
from s2c2a.errors import ActionError, S2C2AError, did_you_mean
from s2c2a.execution.executors import all_cores, validated_worker_count
from s2c2a.integrations.environments.lockstep import Lockstep, in_lockstep
from s2c2a.integrations.environments.spaces import (
    Batch3,
    BatchMoment,
    BatchValues,
    Controls,
    joined,
)
from s2c2a.integrations.environments.tasks import EPISODE_TIME, FAMILIES, Family
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.robots.simulation.chain import get_fidelity
from s2c2a.runtime.limits import CommandLimits
from s2c2a.spaces import POSITION

DIVERGED = -100.0  # reward of a simulation that diverges, worse than any other
MAX_SEED = 2**31  # of robots and sampled arms
USED_BY: set[int] = set()
"""Processes that have begun episodes, this one and those that it was forked from."""
MAX_STEPS = 100_000  # of an episode; goals are sampled when it begins


class BatchStep(NamedTuple):
    """What a step of a batch gives.

    Attributes:
        observations: shape (batch, values).
        rewards: shape (batch,).
        terminated: whether the task ended an episode, or its simulation diverged.
        truncated: whether the time of an episode is over.
        errors: distances of the tips from their goals [m].
    """

    observations: BatchValues
    rewards: Float[np.ndarray, " batch"]
    terminated: Bool[np.ndarray, " batch"]
    truncated: Bool[np.ndarray, " batch"]
    errors: Float[np.ndarray, " batch"]


class SimulationBatch:
    """Simulated arms of one kind, each in an episode of its own.

    Every arm is a `SimulatedRobot`; one call of MuJoCo, on threads of its own, advances
    all of them (`Lockstep`). Episodes begin on threads of Python.

    Args:
        task: name of a family (`FAMILIES`), or a subclass of `Family`.
        arm: preset, arm file, or description.
        count: number of arms.
        randomization: strength of the model mismatch of every episode's arm, 0 to 2
            (`Family.sampled_arm`); 0 simulates the arm itself.
        seconds: duration of an episode [s].
        fidelity: "fast" or "accurate".
        threads: by default as many as cores, and no more than arms.

    Raises:
        S2C2AError: no such task or arm, or a number is out of range.
    """

    def __init__(
        self,
        task: str | type[Family],
        arm: str | os.PathLike | ArmSpec,
        count: int = 1,
        randomization: float = 0.0,
        seconds: float = EPISODE_TIME,
        fidelity: str = "fast",
        threads: int | None = None,
    ):
        self.arm = arm if isinstance(arm, ArmSpec) else load_arm(arm)
        self.controls = Controls.of(self.arm)
        family = FAMILIES.get(task) if isinstance(task, str) else task
        if not isinstance(family, type):
            raise S2C2AError(
                f"no task '{task}'{did_you_mean(str(task), FAMILIES)}; choose one of "
                f"{', '.join(FAMILIES)}, or give a class of your own with task=Mine"
            )
        steps = seconds * self.arm.control_rate
        if not 1 <= steps <= MAX_STEPS:
            raise S2C2AError(
                f"an episode of {seconds} s has {steps:g} control steps; give a duration "
                f"of 1 to {MAX_STEPS} steps"
            )
        self.family = family(self.controls, round(steps), randomization)
        self._limits = CommandLimits.of(self.arm)
        self._fidelity = fidelity
        if count < 1:
            raise S2C2AError(f"{count} environments are not possible; give 1 or more")
        if self.controls.count == 0:
            raise S2C2AError(f"{self.arm.name} has no cables that bend it")
        get_fidelity(fidelity)
        self._robots: dict[int, SimulatedRobot] = {}
        threads = min(validated_worker_count(threads, all_cores), count)
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None
        self._rollout = Rollout(nthread=threads if threads > 1 else 0)
        self._groups: dict[tuple[int, ...], Lockstep] = {}
        rest = self._limits.rest
        self._commands = np.tile(rest, (count, 1, 1))
        self._desired = self._commands.copy()
        self._changes = np.zeros_like(self._commands)
        self._cables = self._commands.copy()
        self._actions = np.zeros((count, self.controls.count))
        self._states = np.zeros((count, self.arm.module_count, 6))
        self._elapsed = np.zeros(count, int)
        self._goals = np.zeros((count, self.family.steps + 2, 3))
        self._forces = np.zeros((count, self.family.steps, 3))
        self._obstacles = np.zeros((count, 4))
        self._diverged = np.zeros(count, bool)

    def reset(
        self,
        numbers: Sequence[int],
        randoms: Sequence[np.random.Generator],
        new_robots: bool,
    ) -> None:
        """Begin episodes.

        Args:
            numbers: of the arms.
            randoms: of these arms, from which everything is sampled.
            new_robots: whether earlier episodes have no influence, as after a seed.

        Raises:
            S2C2AError: this process is a fork of one that used environments, whose
                threads it lacks: JAX would wait for them for ever.
        """
        if USED_BY - {os.getpid()}:
            raise S2C2AError(
                "a fork of a process that used environments would hang; give "
                'make_vec(..., vector_kwargs={"context": "spawn"}), or take '
                'vectorization_mode="vector_entry_point", which is faster'
            )
        USED_BY.add(os.getpid())
        run = map if self._pool is None else self._pool.map
        begin = partial(self._reset_one, new_robots)
        list(run(begin, numbers, randoms))  # an error of one is raised here
        self._groups = in_lockstep(self._robots, self._rollout)

    def step(self, actions: Float[np.ndarray, "batch controls"]) -> BatchStep:
        """Advance all arms by one control step.

        Args:
            actions: within [-1, 1]; values beyond are limited.

        Raises:
            S2C2AError: the actions are not finite numbers of the right shape, or an arm
                has no episode yet.
        """
        values = np.asarray(actions, float)
        if values.shape != self._actions.shape or not np.isfinite(values).all():
            raise ActionError(
                f"actions are finite numbers of shape {self._actions.shape}; got shape "
                f"{values.shape}, {values.tolist()!s:.100}"
            )
        if len(self._robots) < len(values):
            raise S2C2AError("an arm has no episode yet; reset the environments first")
        self._actions = np.clip(values, -1.0, 1.0)
        self._limit(self._actions)
        self._advance()
        self._elapsed += 1
        moment = self.moment()
        shape = self._elapsed.shape
        rewards = self.family.rewards(moment)
        rewards = self._checked("rewards", "(batch,)", rewards, shape)
        ends = self._checked("ends", "(batch,)", self.family.ends(moment), shape)
        return BatchStep(
            self.observations(),
            np.where(self._diverged, DIVERGED, rewards),
            self._diverged | (ends != 0),
            self._elapsed >= self.family.steps,
            np.linalg.norm(moment.tips - moment.goals, axis=-1),
        )

    def observations(self) -> BatchValues:
        """What is observed now; see `spaces`."""
        parts = self.family.observe(self.moment())
        for name, part in parts.items():
            # one value of each arm has an axis, too
            values = np.shape(part)[-1] if np.ndim(part) > 1 else 1
            shape = (len(self._elapsed), values)
            self._checked(f"observe: '{name}'", "(batch, values)", part, shape)
        return joined(parts)

    def moment(self) -> BatchMoment:
        """All arms now."""
        return BatchMoment(
            self._cables,
            self._commands,
            self._actions,
            self._states,
            self._goal_at(0),
            self._goal_at(1),
            self._obstacles,
            self._elapsed,
        )

    def states(self, number: int) -> Float[np.ndarray, "modules 6"]:
        """True states of an arm [m, 1], base frame."""
        return self._states[number]

    def goal(self, number: int) -> Float[np.ndarray, "3"]:
        """The goal of an arm for its next step [m], base frame."""
        return self._goal_at(1)[number]

    def obstacle(self, number: int) -> Float[np.ndarray, "4"] | None:
        """Center and radius of the sphere of an arm [m], base frame, if there is one."""
        sphere = self._obstacles[number]
        return sphere if sphere[3] > 0.0 else None

    def close(self) -> None:
        """End the threads."""
        self._rollout.close()
        if self._pool is not None:
            self._pool.shutdown()

    def _checked(
        self, what: str, axes: str, given: ArrayLike, shape: tuple[int, ...]
    ) -> np.ndarray:
        """What the task gives, where NumPy would broadcast another shape."""
        values = np.asarray(given)
        if values.shape != shape or not np.isfinite(values).all():
            got = values if values.shape == shape else f"shape {values.shape}"
            raise S2C2AError(
                f"{type(self.family).__name__}, {what}: give finite numbers of shape "
                f"{axes}, here {shape}; got {got}"
            )
        return values

    def _check_alike(self, arm: ArmSpec) -> None:
        """Refuse a sampled arm that takes other commands, or another time for a step."""
        expected, given = (
            (each.actuation, each.control_rate, cables_present(each).tolist())
            for each in (self.arm, arm)
        )
        if given != expected:
            raise S2C2AError(
                f"the sampled arm has actuation, control rate and cables {given}; those of "
                f"{self.arm.name} are {expected}: change numbers of its modules alone"
            )

    def _goal_at(self, ahead: int) -> Batch3:
        moments = np.minimum(self._elapsed + ahead, self.family.steps + 1)
        return self._goals[np.arange(len(moments)), moments]

    def _limit(self, actions: Float[np.ndarray, "batch controls"]) -> None:
        """Commands from actions, limited in value, rate and acceleration."""
        step = actions * self.controls.geometry.step_limit  # rad
        desired = self.controls.commands(self.controls.bends(self._commands) + step)
        commands = self._limits.limited(
            desired, self._commands, self._changes, self._desired
        )
        self._changes = commands - self._commands
        self._commands = commands
        self._desired = desired

    def _advance(self) -> None:
        moments = np.minimum(self._elapsed, self.family.steps - 1)
        forces = self._forces[np.arange(len(moments)), moments]
        for group, robots in self._groups.items():
            numbers = np.array(group)
            diverged = robots.advance(self._commands[numbers], forces[numbers])
            self._diverged[numbers] = diverged
            moved = numbers[~diverged]  # others keep their last measurements
            self._cables[moved] = robots.measure_cables()[~diverged]
            self._states[moved] = robots.states()[~diverged]

    def _reset_one(
        self, new_robot: bool, number: int, random: np.random.Generator
    ) -> None:
        is_randomized = self.family.randomization != 0
        if new_robot or is_randomized or number not in self._robots:
            seed = int(random.integers(MAX_SEED))
            arm = self.family.sampled_arm(seed) if is_randomized else self.arm
            self._check_alike(arm)
            self._robots[number] = SimulatedRobot(arm, self._fidelity, seed)
        robot = self._robots[number]
        robot.open()
        # all that an observation needs; `read` measures more
        self._cables[number] = robot.measure_cables()
        self._states[number] = robot.states()
        scenario = self.family.scenario(random, self._states[number, -1, POSITION])
        for name, axes, values in (
            ("goals", "(steps + 2, 3)", self._goals),
            ("forces", "(steps, 3)", self._forces),
            ("obstacle", "(4,)", self._obstacles),
        ):
            given = getattr(scenario, name)
            shape = values[number].shape
            values[number] = self._checked(name, axes, given, shape)
        self._elapsed[number] = 0
        self._commands[number] = self._desired[number] = self._limits.rest
        self._changes[number] = 0.0
        self._actions[number] = 0.0
