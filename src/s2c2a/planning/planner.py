"""The planner: one compiled call from a goal to the next configuration."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.errors import TargetError
from s2c2a.goals import Goal
from s2c2a.kinematics import ForwardModel, bends_from_configurations
from s2c2a.kinematics.forward_model import Memory
from s2c2a.planning.guides import Guide
from s2c2a.planning.options import PlannerOptions
from s2c2a.planning.situation import Bends, Candidate, Configurations, Numbers, Situation, guarded_points
from s2c2a.planning.solvers import Problem, Solver
from s2c2a.planning.terms import Term
from s2c2a.programs import compiled


class Plan(NamedTuple):
    """What the planner carries from step to step.

    Attributes:
        configurations: the last planned ones, C_0 of the next step, shape (modules, 3).
        memory: of the forward model.
    """

    configurations: Configurations
    memory: Memory


class Step(NamedTuple):
    """One control step of planning, with all that it takes; a pytree, so that programs share (`programs.compiled`).

    Attributes:
        arm: its limits count.
        model: predicts states.
        solver: finds configurations.
        terms: what they are judged by.
        guides: what may change the goal before.
        prepared: what each guide knows of the arm.
        options: how else to plan.
    """

    arm: ArmSpec
    model: ForwardModel
    solver: Solver
    terms: tuple[Term, ...]
    guides: tuple[Guide, ...]
    prepared: tuple[Any, ...]
    options: PlannerOptions

    @classmethod
    def of(cls, arm: ArmSpec, model: ForwardModel, options: PlannerOptions) -> "Step":
        """As the options say.

        Raises:
            S2C2AError: a part that they name is not found.
        """
        solver, terms, guides = options.made()
        prepared = tuple(guide.prepared(arm, model, options.guard) for guide in guides)
        return cls(arm, model, solver, terms, guides, prepared, options)

    def started(self, sensed: Configurations) -> Plan:
        """The plan of an arm at rest."""
        return Plan(sensed, self.model.start(sensed))

    def predicted(self, plan: Plan) -> Float[Array, "modules 6"]:
        """The states that the forward model expects of a plan [m, 1], base frame."""
        return self.model.predict(plan.configurations, plan.memory)

    def next_plan(self, plan: Plan, sensed: Configurations, goal: Goal) -> Plan:
        """What one control step plans; what is not finite, in a reading or a goal, must not stay in the plan."""
        memory = _where_finite(self.model.observe(sensed, plan.memory), plan.memory)
        problem = self.problem(plan.configurations, memory, goal)
        following = problem.within_limits(self.solver.solve(problem))
        return Plan(_where_finite(following, plan.configurations), memory)

    def problem(self, last: Configurations, memory: Memory, goal: Goal) -> Problem:
        """What the solver is given, once the guides have seen it."""
        options = self.options
        model = self.model.for_planning() if options.engaged_slopes else self.model
        guarded = guarded_points(self.arm, options.guard)

        def look(configurations: Configurations, bends: Bends) -> Candidate:
            states = model.predict(configurations, memory)
            return Candidate(configurations, bends, states, guarded(states))

        now = look(last, bends_from_configurations(last))
        limits = jnp.asarray(ArmGeometry.of(self.arm).bend_limits, dtype=jnp.float32)
        step = float(np.deg2rad(self.arm.step_limit_deg))
        situation = Situation(
            goal, now, self.arm.length, limits, step, options.on_sphere, shape=now.bends, led=jnp.zeros(())
        )
        for guide, prepared in zip(self.guides, self.prepared, strict=True):
            situation = guide.lead(situation, prepared)
        return Problem(situation, self.terms, look)


class Planner:
    """Plans the next configuration online, one control step at a time.

    Compiles once, when built; targets, obstacles and weights may change with every call.
    """

    def __init__(self, arm: ArmSpec, model: ForwardModel, options: PlannerOptions):
        """Compile for an arm and a forward model."""
        self._modules, step = arm.module_count, Step.of(arm, model, options)
        self._start = compiled(Step.started, step)
        self._predicted = compiled(Step.predicted, step)
        self._next = compiled(Step.next_plan, step)
        self._warm_up()

    def start(self, sensed: Float[Numbers, "modules 3"]) -> Plan:
        """The plan of an arm at rest: stay where the sensors say it is.

        Raises:
            TargetError: what is sensed is not finite.
        """
        if not np.isfinite(sensed).all():
            raise TargetError("the sensed configurations are not finite, and would stay in the plan; read them again")
        return self._start(_single(sensed))

    def plan(self, plan: Plan, sensed: Float[Numbers, "modules 3"], goal: Goal) -> Plan:
        """The next plan; a reading that is not finite is passed over, for the model would never forget it.

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


def _where_finite(new: Any, old: Any) -> Any:
    """The new pytree, or the old one where anything in the new one is not finite."""
    sound = jnp.all(jnp.array([jnp.isfinite(leaf).all() for leaf in jax.tree.leaves(new)], dtype=bool))
    return jax.tree.map(lambda one, other: jnp.where(sound, one, other), new, old)
