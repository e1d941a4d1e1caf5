"""The planner: one compiled call from a goal to the next configuration."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.kinematics import ForwardModel, bends_from_configurations, configurations_from_bends, limit_lengths
from s2c2a.kinematics.forward_model import Memory
from s2c2a.planning.detour import WorkspaceMap, workspace_map
from s2c2a.planning.goal import Goal, Numbers
from s2c2a.planning.guard import guarded_points
from s2c2a.planning.least_squares import solve_least_squares
from s2c2a.planning.losses import norm
from s2c2a.planning.objective import objective
from s2c2a.planning.options import AnyPlannerOptions, LeastSquaresOptions, PlannerOptions
from s2c2a.planning.residuals import goal_residuals
from s2c2a.planning.solver import solve
from s2c2a.programs import compiled

Configurations = Float[Array, "modules 3"]


class Plan(NamedTuple):
    """What the planner carries from step to step.

    Attributes:
        configurations: the last planned ones, C_0 of the next step, shape (modules, 3).
        memory: of the forward model.
    """

    configurations: Float[Array, "modules 3"]
    memory: Memory


class Planner:
    """Plans the next configuration online, one control step at a time.

    Compiles once, when built; targets, obstacles and weights may change with every call.
    """

    def __init__(self, arm: ArmSpec, model: ForwardModel, length_scale: float, options: AnyPlannerOptions):
        """Compile for an arm and a forward model; `length_scale` is what a length of one stands for [m]."""
        self._modules = arm.module_count
        self._start = compiled(started, model)
        self._predicted = compiled(_predicted, model)
        self._next = compiled(next_plan, *solver_of(arm, model, length_scale, options), model)
        self._warm_up()

    def start(self, sensed: Float[Numbers, "modules 3"]) -> Plan:
        """The plan of an arm at rest: stay where the sensors say it is."""
        return self._start(_single(sensed))

    def plan(self, plan: Plan, sensed: Float[Numbers, "modules 3"], goal: Goal) -> Plan:
        """The next plan.

        Args:
            plan: the last one.
            sensed: the latest sensed configuration.
            goal: for the next state.
        """
        return self._next(plan, _single(sensed), goal)

    def predicted(self, plan: Plan) -> Float[Array, "modules 6"]:
        """The states that the forward model expects of a plan [m, 1], base frame; compiles when first called."""
        return self._predicted(plan)

    def _warm_up(self) -> None:
        straight = np.tile([0.0, 0.0, 1.0], (self._modules, 1))
        jax.block_until_ready(self.plan(self.start(straight), straight, Goal.of(self._modules)))


def _single(values: Numbers) -> Numbers:
    return values if isinstance(values, jax.Array) else np.asarray(values, np.float32)


def started(model: ForwardModel, sensed: Configurations) -> Plan:
    """The plan of an arm at rest (`Planner.start`)."""
    return Plan(sensed, model.start(sensed))


def _predicted(model: ForwardModel, plan: Plan) -> Float[Array, "modules 6"]:
    return model.predict(plan.configurations, plan.memory)


def solver_of(arm: ArmSpec, model: ForwardModel, length_scale: float, options: AnyPlannerOptions):
    """The solver that the options ask for, and the parts that it takes first."""
    if isinstance(options, LeastSquaresOptions):
        return _by_least_squares, (arm, options, workspace_map(arm, model, options.guard))
    return _as_the_paper, (arm, options, length_scale)


def next_plan(solver, parts: tuple, model: ForwardModel, plan: Plan, sensed: Configurations, goal: Goal) -> Plan:
    """What one control step plans (`Planner.plan`)."""
    memory = model.observe(sensed, plan.memory)
    following = solver(*parts, model, memory, goal, plan.configurations)
    sound = jnp.isfinite(following).all()  # a goal built by hand can hold anything; it must not stay in the plan
    return Plan(jnp.where(sound, following, plan.configurations), memory)


def _as_the_paper(
    arm: ArmSpec,
    options: PlannerOptions,
    length_scale: float,
    model: ForwardModel,
    memory: Memory,
    goal: Goal,
    last: Configurations,
) -> Configurations:
    """Adam on configurations, its result then brought within the step and the bend limits."""
    bend_limits, longest_step = _limits(arm)

    def project(configurations):
        return configurations / norm(configurations)[:, None] if options.on_sphere else configurations

    def within_limits(wanted):
        """Bends change by at most the step; the angle between two configurations is never more than that."""
        if not options.on_sphere:
            return last + limit_lengths(wanted - last, longest_step)
        start = bends_from_configurations(last)
        change = limit_lengths(bends_from_configurations(wanted), bend_limits) - start
        return configurations_from_bends(start + limit_lengths(change, longest_step))

    guarded = guarded_points(arm, options.guard)
    value = objective(model, memory, goal, last, length_scale, guarded)
    return within_limits(solve(value, last, project, options.learning_rate, options.iterations))


def _by_least_squares(
    arm: ArmSpec,
    options: LeastSquaresOptions,
    workspace: WorkspaceMap,
    model: ForwardModel,
    memory: Memory,
    goal: Goal,
    last: Configurations,
) -> Configurations:
    """Damped least squares on bends; every iterate stays within the step, the result within the bend limits."""
    bend_limits, longest_step = _limits(arm)
    start = bends_from_configurations(last)

    def within_step(flat: Float[Array, " variables"]) -> Float[Array, " variables"]:
        return (start + limit_lengths(flat.reshape(start.shape) - start, longest_step)).reshape(-1)

    residuals = goal_residuals(
        model.for_planning() if options.engaged_slopes else model,
        memory,
        goal,
        start,
        bend_limits,
        arm.length,
        guarded_points(arm, options.guard),
        workspace,
        options,
    )
    flat = solve_least_squares(residuals, start.reshape(-1), within_step, options.iterations)
    allowed = limit_lengths(flat.reshape(start.shape), bend_limits)  # an arm can begin beyond its bend limits
    return configurations_from_bends(start + limit_lengths(allowed - start, longest_step))


def _limits(arm: ArmSpec) -> tuple[Float[Array, " modules"], float]:
    """Largest bends [rad], and their largest change in a step [rad]."""
    return jnp.asarray(ArmGeometry.of(arm).bend_limits, dtype=jnp.float32), float(np.deg2rad(arm.step_limit_deg))
