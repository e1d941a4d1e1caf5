"""The planner: one compiled call from a goal to the next configuration."""

from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.errors import TargetError
from s2c2a.kinematics import ForwardModel, bends_from_configurations, configurations_from_bends, limit_lengths
from s2c2a.kinematics.forward_model import Memory
from s2c2a.planning.goal import Goal, Numbers
from s2c2a.planning.losses import norm
from s2c2a.planning.objective import objective
from s2c2a.planning.solver import solve

MOST_ITERATIONS = 10_000


@dataclass(frozen=True)
class PlannerOptions:
    """How to plan.

    Attributes:
        learning_rate: of Adam.
        iterations: of Adam in a control step.
        on_sphere: whether each module's vector returns to unit length after every iteration, and stays within the
            module's bend limit. Sensed configurations under sensing coupling are not of unit length.
    """

    learning_rate: float = 0.02
    iterations: int = 10
    on_sphere: bool = True

    def __post_init__(self):
        """Refuse what cannot be solved."""
        if not (self.learning_rate > 0 and 1 <= self.iterations <= MOST_ITERATIONS):
            raise TargetError(
                f"a planner with learning rate {self.learning_rate} and {self.iterations} iterations was asked for; "
                f"take a positive rate and 1 to {MOST_ITERATIONS} iterations"
            )


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

    def __init__(self, arm: ArmSpec, model: ForwardModel, length_scale: float, options: PlannerOptions):
        """Compile for an arm and a forward model; `length_scale` is what a length of one stands for [m]."""
        self._modules, self._cables = arm.module_count, arm.cable_count
        self._start = jax.jit(lambda configurations, cables: Plan(configurations, model.start(cables)))
        self._next = jax.jit(_next_plan(arm, model, length_scale, options))
        self._warm_up()

    def start(self, configurations: Float[Numbers, "modules 3"], cables: Float[np.ndarray, "modules cables"]) -> Plan:
        """The plan of an arm at rest: stay where the sensors say it is."""
        return self._start(_single(configurations), _single(cables))

    def plan(self, plan: Plan, cables: Float[np.ndarray, "modules cables"], goal: Goal) -> Plan:
        """The next plan.

        Args:
            plan: the last one.
            cables: the latest reading [m or N].
            goal: for the next state.
        """
        return self._next(plan, _single(cables), goal)

    def _warm_up(self) -> None:
        straight = np.tile([0.0, 0.0, 1.0], (self._modules, 1))
        cables = np.zeros((self._modules, self._cables))
        plan = self.start(straight, cables)
        jax.block_until_ready(self.plan(plan, cables, Goal.of(self._modules)))


def _single(values: Numbers) -> Numbers:
    return values if isinstance(values, jax.Array) else np.asarray(values, np.float32)


def _next_plan(arm: ArmSpec, model: ForwardModel, length_scale: float, options: PlannerOptions):
    bend_limits = jnp.asarray(ArmGeometry.of(arm).bend_limits, dtype=jnp.float32)
    longest_step = np.deg2rad(arm.step_limit_deg)

    def project(configurations):
        return configurations / norm(configurations)[:, None] if options.on_sphere else configurations

    def within_limits(wanted, last):
        """Bends change by at most the step; the angle between two configurations is never more than that."""
        if not options.on_sphere:
            return last + limit_lengths(wanted - last, longest_step)
        start = bends_from_configurations(last)
        change = limit_lengths(bends_from_configurations(wanted), bend_limits) - start
        return configurations_from_bends(start + limit_lengths(change, longest_step))

    def next_plan(plan: Plan, cables, goal: Goal) -> Plan:
        memory = model.observe(cables, plan.memory)
        value = objective(model, memory, goal, plan.configurations, length_scale)
        wanted = solve(value, plan.configurations, project, options.learning_rate, options.iterations)
        following = within_limits(wanted, plan.configurations)
        sound = jnp.isfinite(following).all()  # a goal built by hand can hold anything; it must not stay in the plan
        return Plan(jnp.where(sound, following, plan.configurations), memory)

    return next_plan
