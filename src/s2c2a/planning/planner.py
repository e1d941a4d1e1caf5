"""The planner: one compiled call from a goal to the next configuration, and how to plan.

`PAPER` is the paper's way, with its terms, guides and solver, `BEST` that of the recipe
`best`.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from pydantic import BeforeValidator, ConfigDict, SkipValidation

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.errors import S2C2AError, TargetError
from s2c2a.goals import Goal
from s2c2a.kinematics import (
    ForwardModel,
    bends_from_configurations,
    configurations_from_bends,
)
from s2c2a.kinematics.pcc import Memory
from s2c2a.components import Own
from s2c2a.planning import terms
from s2c2a.planning.guides import GUIDES, Detour, Guide, Pull
from s2c2a.planning.fallback import NO_FALLBACK, FALLBACKS, FallbackSearch, Search
from s2c2a.planning.solvers import SOLVERS, Adam, LeastSquares, Problem, Solver
from s2c2a.planning.terms import (
    TERMS,
    Bends,
    Candidate,
    Configurations,
    Guard,
    Numbers,
    Situation,
    Term,
)
from s2c2a.compilation import compiled, where_finite

AXES_WEIGHT = 0.5
"""Of `best`: a degree counts for as much as 2 mm at the end of an arm of 0.6 m. Where
an arm cannot have both, as one that is shorter than its file says, its ends stay near
their places."""
WORKSPACE_SHARE = 0.46 / 0.6
"""Half the width of the paper's workspace over the length of its arm (Chen et al. 2025,
sec. II-D)."""

AnySolver = Annotated[Solver | Own, SkipValidation, BeforeValidator(SOLVERS.read)]
AnyTerm = Annotated[Term | Own, SkipValidation, BeforeValidator(TERMS.read)]
AnyGuide = Annotated[Guide | Own, SkipValidation, BeforeValidator(GUIDES.read)]
AnyFallback = Annotated[
    FallbackSearch | Own, SkipValidation, BeforeValidator(FALLBACKS.read)
]


@dataclass(frozen=True)
class PlannerOptions:
    """What a planner is made of. In files, parts are tables with their name and numbers, or `Own`.

    Attributes:
        solver: finds configurations.
        terms: what they are judged by.
        guides: what may change the goal before, one after the other.
        engaged_slopes: whether slopes are those of taut cables that follow their motors
            (`ForwardModel.for_planning`), or the true ones.
        on_sphere: whether configurations are kept at unit length and within the bend
            limits. Those sensed under sensing coupling are not of unit length.
        fallback: what takes over where a plan stands although its cost could fall.
        guard: what keeps out of obstacles.
        own_code: whether parts by name may be files and modules; never in a strategy
            file, which may be a stranger's.
    """

    __pydantic_config__: ClassVar[ConfigDict] = {"extra": "forbid"}

    solver: AnySolver
    terms: tuple[AnyTerm, ...]
    guides: tuple[AnyGuide, ...] = ()
    engaged_slopes: bool = False
    on_sphere: bool = True
    fallback: AnyFallback = NO_FALLBACK
    guard: Guard = "tip"
    own_code: bool = field(default=True, compare=False)

    def __post_init__(self):
        """Refuse what cannot plan."""
        if not self.terms:
            raise S2C2AError("a planner without terms asked for; give at least one")

    def made(
        self,
    ) -> tuple[Solver, tuple[Term, ...], tuple[Guide, ...], FallbackSearch]:
        """Solver, terms, guides and fallback; those asked for by name are found.

        Raises:
            S2C2AError: one is not found, may not be imported, or does not take its
                parameters.
        """
        terms = tuple(TERMS.made(term, self.own_code) for term in self.terms)
        guides = tuple(GUIDES.made(guide, self.own_code) for guide in self.guides)
        fallback = FALLBACKS.made(self.fallback, self.own_code)
        return SOLVERS.made(self.solver, self.own_code), terms, guides, fallback


PAPER = PlannerOptions(
    Adam(),
    (
        terms.Positions(WORKSPACE_SHARE),
        terms.Axes(),
        terms.Repulsion(WORKSPACE_SHARE),
        terms.Change(),
    ),
)
_DESIRED = terms.Positions(), terms.Axes(AXES_WEIGHT), terms.Shape(), terms.Evenness()
_KEPT = terms.BendChange(), terms.Extrapolation(), terms.Limits(), terms.Obstacles()
BEST = PlannerOptions(
    LeastSquares(),
    _DESIRED + _KEPT,
    (Detour(), Pull()),
    engaged_slopes=True,
    fallback=FallbackSearch(),
)


class Plan(NamedTuple):
    """What the planner carries from step to step.

    Attributes:
        configurations: the last planned ones, C_0 of the next step, shape (modules, 3).
        memory: of the forward model.
        search: for better shapes than those at hand.
    """

    configurations: Configurations
    memory: Memory
    search: Search


class Expectation(NamedTuple):
    """What a plan is expected to lead to.

    Attributes:
        states: [m, 1], shape (modules, 6), base frame.
        deviation: distance of ends from there that must be expected [m], shape
            (modules,); zero if not known.
        extrapolation: how much of it is because nothing was learned near there [m].
    """

    states: Float[Array, "modules 6"]
    deviation: Float[Array, " modules"]
    extrapolation: Float[Array, ""]


class Step(NamedTuple):
    """One control step of planning, with all that it takes; a pytree, so that programs share (`programs.compiled`).

    Attributes:
        arm: its limits count.
        model: predicts states.
        solver: finds configurations.
        terms: what they are judged by.
        guides: what may change the goal before.
        fallback: what takes over where a plan stands.
        prepared: what each guide knows of the arm.
        options: how else to plan.
    """

    arm: ArmSpec
    model: ForwardModel
    solver: Solver
    terms: tuple[Term, ...]
    guides: tuple[Guide, ...]
    fallback: FallbackSearch
    prepared: tuple[Any, ...]
    options: PlannerOptions

    @classmethod
    def of(cls, arm: ArmSpec, model: ForwardModel, options: PlannerOptions) -> "Step":
        """As the options say.

        Raises:
            S2C2AError: a part that they name is not found.
        """
        solver, terms, guides, fallback = options.made()
        prepared = tuple(guide.prepared(arm, model, options.guard) for guide in guides)
        return cls(arm, model, solver, terms, guides, fallback, prepared, options)

    def started(self, sensed: Configurations) -> Plan:
        """The plan of an arm at rest."""
        return Plan(
            sensed,
            self.model.start(sensed),
            Search.none(bends_from_configurations(sensed)),
        )

    def expectation(self, plan: Plan) -> Expectation:
        """What the forward model expects of a plan."""
        where = plan.configurations, plan.memory
        return Expectation(
            self.model.predict(*where),
            self.model.predictive_std(*where),
            self.model.extrapolation(where[0]),
        )

    def next_plan(self, plan: Plan, sensed: Configurations, goal: Goal) -> Plan:
        """What one control step plans; what is not finite, in a reading or a goal, must not stay in the plan."""
        memory = where_finite(self.model.observe(sensed, plan.memory), plan.memory)
        problem = self.problem(plan.configurations, memory, goal)
        following = problem.within_limits(self.solver.solve(problem))
        search = plan.search
        if self.fallback.starts:
            true = problem._replace(
                look=self._look(plan.configurations, memory, engaged=False)
            )
            bends, search = self.fallback.over(
                true, goal, bends_from_configurations(following), search
            )
            other = problem.within_limits(configurations_from_bends(bends))
            following = jnp.where(search.notes.rescued > 0, other, following)
        new = (following, search)
        old = (plan.configurations, Search.none(problem.situation.last.bends))
        following, search = where_finite(new, old)
        return Plan(following, memory, search)

    def problem(self, last: Configurations, memory: Memory, goal: Goal) -> Problem:
        """What the solver is given, once the guides have seen it."""
        options = self.options
        look = self._look(last, memory, self.options.engaged_slopes)
        now = look(last, bends_from_configurations(last))
        limits = jnp.asarray(ArmGeometry.of(self.arm).planned_bends, dtype=jnp.float32)
        step = float(np.deg2rad(self.arm.step_limit_deg))
        situation = Situation(
            goal,
            now,
            self.arm.length,
            limits,
            step,
            options.on_sphere,
            shape=now.bends,
            led=jnp.zeros(()),
        )
        for guide, prepared in zip(self.guides, self.prepared, strict=True):
            situation = guide.lead(situation, prepared)
        return Problem(situation, self.terms, look)

    def _look(
        self, last: Configurations, memory: Memory, engaged: bool
    ) -> Callable[[Configurations, Bends], Candidate]:
        model = (self.model.for_planning() if engaged else self.model).near(
            last, memory
        )
        guarded = terms.guarded_points(self.arm, self.options.guard)

        def look(configurations: Configurations, bends: Bends) -> Candidate:
            states = model.predict(configurations, memory)
            return Candidate(
                configurations,
                bends,
                states,
                guarded(states),
                model.extrapolation(configurations),
            )

        return look


class Planner:
    """Plans the next configuration online, one control step at a time.

    Compiles once, when built; targets, obstacles and weights may change with every
    call.
    """

    def __init__(self, arm: ArmSpec, model: ForwardModel, options: PlannerOptions):
        """Compile for an arm and a forward model."""
        self.model = model
        self._modules = arm.module_count
        step = Step.of(arm, model, options)
        self._start = compiled(Step.started, step)
        self._expectation = compiled(Step.expectation, step)
        self._next = compiled(Step.next_plan, step)
        self._warm_up()

    def start(self, sensed: Float[Numbers, "modules 3"]) -> Plan:
        """The plan of an arm at rest: stay where the sensors say it is.

        Raises:
            TargetError: what is sensed is not finite.
        """
        if not np.isfinite(sensed).all():
            raise TargetError(
                "the sensed configurations are not finite, and would stay in the plan; read them again"
            )
        return self._start(_single(sensed))

    def plan(self, plan: Plan, sensed: Float[Numbers, "modules 3"], goal: Goal) -> Plan:
        """The next plan; a reading that is not finite is passed over, for the model would never forget it.

        Args:
            plan: the last one.
            sensed: the latest sensed configuration.
            goal: for the next state.
        """
        return self._next(plan, _single(sensed), goal)

    def expectation(self, plan: Plan) -> Expectation:
        """What the forward model expects of a plan; compiles when first called."""
        return self._expectation(plan)

    def _warm_up(self) -> None:
        straight = np.tile([0.0, 0.0, 1.0], (self._modules, 1))
        jax.block_until_ready(
            self.plan(self.start(straight), straight, Goal.of(self._modules))
        )


def _single(values: Numbers) -> Numbers:
    return values if isinstance(values, jax.Array) else np.asarray(values, np.float32)
