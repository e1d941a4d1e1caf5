"""One control step of a strategy as a function without side effects.

It estimates, plans, acts and limits the command, as the control loop does
(`runtime.Loop`), and takes and returns its memory. What waits or branches outside of
compiled programs is not in it: the search for ways around obstacles (`Detour`), checks
of readings, and the emergency stop.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from s2c2a.errors import StrategyError
from s2c2a.estimation import Estimate, StateEstimator
from s2c2a.estimation.estimator import EncoderEstimator, sense
from s2c2a.estimation.kalman_estimator import (
    KalmanEstimator,
    start_estimate,
    update_estimate,
)
from s2c2a.estimation.measurements import missing_values
from s2c2a.execution.compilation import select
from s2c2a.goals import Goal
from s2c2a.planning import Plan
from s2c2a.runtime.limits import CommandLimits, command_range
from s2c2a.strategies.strategy import Strategy

Measured = Mapping[str, Array | np.ndarray]
Commands = Float[Array, "modules cables"]


class StepInput(NamedTuple):
    """What a control step reads.

    Attributes:
        measured: sensor name -> values of the sensors that give configurations, such as
            cables [m].
        measurements: name -> values of the other sensors that the state estimator
            takes; NaN where they are missing.
        goal: for the state after the command.
    """

    measured: Measured
    measurements: Measured
    goal: Goal


class StepMemory(NamedTuple):
    """What a control step remembers.

    Attributes:
        estimate: of the state.
        plan: of the last step.
        controller: memory of the controller.
        command: last command [m or N], shape (modules, cables).
        change: that it made.
        desired: command of the last step before its limits.
        is_sound: whether the last step followed its input; if not, it held.
    """

    estimate: Estimate
    plan: Plan
    controller: Any
    command: Commands
    change: Commands
    desired: Commands
    is_sound: Bool[Array, ""]


class ControlStep:
    """The functions of a strategy's control step.

    Attributes:
        arm: that is driven.
    """

    def __init__(self, strategy: Strategy):
        """The control step of a strategy.

        Raises:
            StrategyError: its state estimator is not one of the package.
        """
        self.arm = strategy.arm
        self._estimator = functions_of(strategy.estimator)
        self._planner = strategy.planner.step
        self._controller = strategy.controller
        self._limits = CommandLimits.of(strategy.arm)

    def example(self) -> StepInput:
        """Input of an arm at rest without a goal, of the right shapes."""
        arm = self.arm
        cables = np.zeros((arm.module_count, arm.cable_count), np.float32)
        straight = np.tile(np.array([0, 0, 1], np.float32), (arm.module_count, 1))
        known = {"cables": cables, "configurations": straight}
        try:
            measured = {name: known[name] for name in self._estimator.sensors}
        except KeyError as error:
            raise StrategyError(
                f"the sensor {error} of a configuration map of your own has no known "
                "shape, so this strategy cannot be exported; use encoders"
            ) from error
        measurements = self._estimator.missing
        return StepInput(measured, measurements, Goal.of(arm.module_count))

    def start(self, measured: Measured) -> StepMemory:
        """Memory of an arm at rest.

        Args:
            measured: first reading (`StepInput`).
        """
        estimate = self._estimator.start(measured)
        configuration = jnp.asarray(estimate.configuration)
        disturbances = estimate.disturbances
        hysteresis = estimate.hysteresis
        plan = self._planner.started(configuration, disturbances, hysteresis)
        rest = jnp.asarray(self._limits.rest, jnp.float32)
        none = jnp.zeros_like(rest)
        memory = self._controller.start(configuration)
        is_sound = jnp.isfinite(configuration).all()
        return StepMemory(
            estimate=estimate,
            plan=plan,
            controller=memory,
            command=rest,
            change=none,
            desired=rest,
            is_sound=is_sound,
        )

    def step(
        self, memory: StepMemory, reading: StepInput
    ) -> tuple[Commands, StepMemory]:
        """The next command [m or N], and the memory after it.

        After a reading or a goal that is not finite, the last command holds, and the rest
        of the memory stays; after such a start, every command does.
        """
        estimate = self._estimator.update(
            memory.estimate, reading.measured, reading.measurements
        )
        configuration = jnp.asarray(estimate.configuration)
        plan = self._planner.next_plan(
            memory.plan,
            configuration,
            reading.goal,
            estimate.disturbances,
            estimate.hysteresis,
            seen=estimate.seen,
        )
        desired, controller = self._controller.act(
            plan.configurations, configuration, memory.controller
        )
        limit: Any = self._limits.limited  # written for NumPy and JAX alike
        command = limit(desired, memory.command, memory.change, memory.desired)
        # a limiter stops within its range, and servos may reach less
        limited = jnp.clip(jnp.asarray(command, jnp.float32), *command_range(self.arm))
        controller = self._controller.sent(limited, controller)
        change = limited - memory.command
        checks = jax.tree.map(_is_known, reading, self.example())
        is_sound = jnp.array(jax.tree.leaves(checks)).all()
        is_sound &= jnp.isfinite(configuration).all() & jnp.isfinite(desired).all()
        new = StepMemory(
            estimate=estimate,
            plan=plan,
            controller=controller,
            command=limited,
            change=change,
            desired=desired,
            is_sound=is_sound,
        )
        held = memory._replace(
            change=jnp.zeros_like(change), desired=memory.command, is_sound=is_sound
        )
        new = select(is_sound, new, held)
        return new.command, new


def _is_known(values: Array, example: np.ndarray) -> Bool[Array, ""]:
    """Whether values are finite, or NaN where NaN means that they are not known."""
    unknown = jnp.isnan(values) & jnp.isnan(example)
    return (jnp.isfinite(values) | unknown).all()


class EstimatorFunctions(NamedTuple):
    """A state estimator as functions without side effects.

    Attributes:
        sensors: names of the sensors that give configurations.
        missing: measurements of the other sensors, all missing.
        start: from the first measured values to the estimate.
        update: from the last estimate, measured values and measurements to the next.
    """

    sensors: tuple[str, ...]
    missing: dict[str, np.ndarray]
    start: Callable[[Measured], Estimate]
    update: Callable[[Estimate, Measured, Measured], Estimate]


def functions_of(estimator: StateEstimator) -> EstimatorFunctions:
    """The functions of a state estimator.

    Raises:
        StrategyError: it is not one of the package.
    """
    if isinstance(estimator, EncoderEstimator):

        def start(measured: Measured) -> Estimate:
            configuration, hysteresis = _sensed(estimator, measured, None)
            if not estimator.payload:
                return Estimate(configuration, hysteresis=hysteresis)
            return Estimate.of(configuration, estimator.payload, hysteresis=hysteresis)

        def update(last: Estimate, measured: Measured, measurements: Any) -> Estimate:
            configuration, hysteresis = _sensed(estimator, measured, last.hysteresis)
            return last._replace(configuration=configuration, hysteresis=hysteresis)

        return EstimatorFunctions(estimator.sensors, {}, start, update)
    if isinstance(estimator, KalmanEstimator):
        return _kalman_functions(estimator)
    raise StrategyError(
        f"the state estimator {type(estimator).__name__} is not one of the package, so "
        "its control step cannot be exported; use KalmanFilter or EncoderOnly"
    )


def _sensed(
    estimator: EncoderEstimator, measured: Measured, hysteresis: Any
) -> tuple[Array, Any]:
    return sense(estimator.configuration_map, estimator.model, measured, hysteresis)


def _kalman_functions(estimator: KalmanEstimator) -> EstimatorFunctions:
    parts = estimator.configuration_map, estimator.filter

    def start(measured: Measured) -> Estimate:
        return start_estimate(*parts, measured, jnp.asarray(estimator.payload))

    def update(last: Estimate, measured: Measured, measurements: Any) -> Estimate:
        return update_estimate(*parts, last.memory, measured, measurements)

    missing = missing_values(estimator.filter.sensors)
    return EstimatorFunctions(estimator.sensors, missing, start, update)
