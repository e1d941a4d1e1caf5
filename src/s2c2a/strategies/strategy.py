"""A strategy: sense, plan, act (Chen et al. 2025, fig. 1C); and those of PCC, the comparisons of the paper.

They have PCC in the planner, inverse PCC behind it, and no feedback.
"""

import operator
from functools import cached_property
from typing import Any, Protocol, TypeVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmSpec
from s2c2a.control import Controller, InversePCC
from s2c2a.data import Recording
from s2c2a.errors import RecordingError, StrategyError
from s2c2a.estimation import Margins, Observer, margins_of
from s2c2a.kinematics import (
    PCC,
    PCCForwardModel,
    bends_from_configurations,
    bends_from_states,
    configurations_from_bends,
)
from s2c2a.planning import Goal, Notes, Plan, Planner, PlannerOptions
from s2c2a.compilation import compiled
from s2c2a.runtime import Driver
from s2c2a.sensing import EncoderEstimator, Estimator
from s2c2a.spaces import Actions, Reading
from s2c2a.strategies.watch import Watch

Carried = TypeVar("Carried")
Sensed = Float[Array, "modules 3"]


class AnyStrategy(Driver, Protocol):
    """What every strategy can do, beside driving an arm; `Strategy` says it in full."""

    @property
    def name(self) -> str:
        """Such as "s2c2a"."""


class Strategy:
    """Estimator, planner and controller of one arm, and what they carry from step to step.

    Nothing compiles after the strategy is built.

    Attributes:
        name: such as "s2c2a".
        arm: the arm that it drives.
        sensors: names of the sensors that it needs.
    """

    def __init__(
        self,
        name: str,
        arm: ArmSpec,
        estimator: Estimator,
        planner: Planner,
        controller: Controller,
        observer: Observer | None = None,
        load: float = 0.0,
    ):
        """Put the parts together and compile them.

        Args:
            name: such as "s2c2a".
            arm: the arm.
            estimator: what configurations are.
            planner: for them.
            controller: for what is planned.
            observer: of what comes of it; nothing is known but what encoders say if
                None.
            load: at the tip, as far as it is told [kg].
        """
        self.name = name
        self.arm = arm
        self.sensors = estimator.sensors
        self._planner = planner
        # Equinox takes as long to look a method up as sensing does
        self._inputs = estimator.inputs
        self._plan: Plan | None = None
        self._memory: Any = None
        self._sense = compiled(operator.call, estimator)
        self._start_control = compiled(type(controller).start, controller)
        self._act = compiled(_acted, controller)
        self._watch = (
            Watch(arm, planner, observer, load) if observer is not None else None
        )
        self._after = compiled(type(controller).sent, controller)
        self._warm_up()

    @cached_property
    def margins(self) -> Margins | None:
        """Of the loop of what it sensors beside its encoders; None where there is none. Takes a moment, once."""
        observer = self._watch.observer if self._watch is not None else None
        return (
            margins_of(self.arm, observer)
            if observer is not None and observer.sensors
            else None
        )

    def start(self, reading: Reading) -> None:
        """Begin from an arm at rest.

        Raises:
            StrategyError: the sensors gave no finite numbers.
        """
        self._begin(self._sensed_in(reading), reading)

    def step(self, reading: Reading, goal: Goal) -> Actions:
        """The action of one control step.

        Args:
            reading: the latest.
            goal: for the state after the action.

        Raises:
            StrategyError: it was not started, or the sensors gave no finite numbers;
                the next reading may be better.

        Returns:
            Displacements [m] or tensions [N], shape (modules, cables).
        """
        last = started(self._plan, "call start(reading) with the arm at rest first")
        return self._action(last, self._sensed_in(reading), goal, reading)

    def sent(self, action: Actions) -> None:
        """An action was sent in place of the last one, which a limit did not allow."""
        self._memory = self._after(np.asarray(action, np.float32), self._memory)

    def diagnostics(self) -> dict[str, np.ndarray]:
        """What it sensed, planned and expects, by column of an episode.

        The latest configurations, sensed and planned, of shape (modules, 3), module
        frames; the states [m, 1] that the plan is expected to lead to, of shape
        (modules, 6), base frame, how far off ends must be expected to be [m], of shape
        (modules,), and how much of that is because nothing was learned there; what took
        over where the plan would have stood (`planning.fallback`), and whether it stands
        although its cost could fall.

        Raises:
            StrategyError: it was not started.
        """
        plan = started(self._plan, "it has planned nothing yet")
        found = self._planner.expectation(plan)
        expected = {"predicted": np.asarray(found.states, dtype=float)}
        expected |= {
            "predictive_std": np.asarray(found.deviation),
            "extrapolation": np.asarray(found.extrapolation),
        }
        notes = Notes(*np.asarray(plan.search.numbers))
        search = {
            "rescued": np.asarray(notes.rescued),
            "standing": np.asarray(notes.standing),
        }
        shapes = {
            "sensed": np.asarray(self._sensed),
            "planned": np.asarray(plan.configurations),
        }
        watched = self._watch.diagnostics() if self._watch is not None else {}
        return shapes | expected | search | watched

    def _sensed_in(self, reading: Reading):
        sensed = self._sense(self._inputs(reading))
        # it would stay in what planner and controller remember
        if not np.isfinite(np.asarray(sensed)).all():
            raise StrategyError(
                "the sensors gave no finite numbers; nothing was planned, and the arm was not moved"
            )
        return sensed

    def _begin(self, sensed: Sensed, reading: Reading) -> None:
        self._plan = self._planner.start(sensed)
        self._sensed = sensed
        self._memory = self._start_control(sensed)
        if self._watch is not None:
            self._plan = self._watch.begun(self._plan)

    def _action(
        self, last: Plan, sensed: Sensed, goal: Goal, reading: Reading
    ) -> Actions:
        beside: Any = 0.0
        if self._watch is not None:
            last, beside = self._watch.seen(last, sensed, reading)
        self._plan = self._planner.plan(last, sensed, goal)
        self._sensed = sensed
        action, self._memory = self._act(
            self._plan.configurations, beside, sensed, self._memory
        )
        return np.asarray(action, dtype=np.float64)

    def _warm_up(self) -> None:
        """Compile all; of a sensor of the user's, whose shape is not known here, only the estimator is left."""
        straight = jnp.tile(jnp.array([0.0, 0.0, 1.0]), (self.arm.module_count, 1))
        cables = np.zeros((self.arm.module_count, self.arm.cable_count))
        known = Reading(0.0, {"cables": cables, "configurations": np.asarray(straight)})
        sensed = (
            self._sensed_in(known)
            if set(self.sensors) <= set(known.sensors)
            else straight
        )
        self._begin(sensed, known)
        self._action(
            started(self._plan, ""), sensed, Goal.of(self.arm.module_count), known
        )
        self.sent(cables)
        self.diagnostics()
        self._plan = None


def _acted(
    controller: Controller, desired: Sensed, beside, sensed: Sensed, memory: Any
):
    """What a controller does for what is planned, and bends that are asked for beside it [rad]."""
    asked = configurations_from_bends(bends_from_configurations(desired) + beside)
    return controller.act(asked, sensed, memory)


def started(carried: Carried | None, otherwise: str) -> Carried:
    """What a strategy carries from step to step.

    Raises:
        StrategyError: it was not started.
    """
    if carried is None:
        raise StrategyError(f"this strategy was not started; {otherwise}")
    return carried


def pcc_strategy(arm: ArmSpec, options: PlannerOptions) -> Strategy:
    """PCC with the arm's nominal numbers."""
    return _pcc("pcc", arm, options, np.ones(arm.module_count))


def pcc_fitted_strategy(recording: Recording, options: PlannerOptions) -> Strategy:
    """PCC with one gain a module, fitted on a recording."""
    return _pcc("pcc-fitted", recording.arm, options, 1.0 / fitted_gains(recording))


def fitted_gains(recording: Recording) -> Float[np.ndarray, " modules"]:
    """True bend over the bend that the cables say, per module, by least squares over all samples.

    Raises:
        RecordingError: episodes are missing, no true states, or a module that did not
            move.
    """
    recording.check_complete()
    said = np.asarray(
        PCC.of(recording.arm).bends(
            jnp.asarray(recording.sensor("cables"), dtype=jnp.float32)
        )
    )
    states = jnp.asarray(recording.sensor("states"), dtype=jnp.float32)
    true = np.asarray(bends_from_states(states))
    everything = (0, 1, 3)
    together = (true * said).sum(axis=everything)
    alone = (said**2).sum(axis=everything)
    if not (
        np.isfinite(together).all() and (together > 1e-6).all() and (alone > 1e-6).all()
    ):
        raise RecordingError(
            "gains cannot be fitted: the recording lacks true states, or a module stood still"
        )
    return together / alone


def _pcc(
    name: str,
    arm: ArmSpec,
    options: PlannerOptions,
    gains: Float[np.ndarray, " modules"],
) -> Strategy:
    pcc = PCC.of(arm)
    planner = Planner(arm, PCCForwardModel.of(arm), options)
    return Strategy(
        name,
        arm,
        EncoderEstimator(pcc),
        planner,
        InversePCC(pcc, jnp.asarray(gains, dtype=jnp.float32)),
    )
