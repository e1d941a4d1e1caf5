"""The planner: one compiled call from a goal to the next configuration.

`PAPER` holds the planner options of the paper, `BEST` those of the recipe `best`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int
from pydantic import BeforeValidator, SkipValidation

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.errors import S2C2AError, TargetError
from s2c2a.estimation import Estimate, ModalFactors
from s2c2a.execution.compilation import all_finite, compiled, select, select_if_finite
from s2c2a.goals import PREVIEW, START_TIME, Goal
from s2c2a.kinematics import (
    bends_from_configurations,
    commanded_configurations,
    commanded_part,
    configurations_from_bends,
    limit_lengths,
    states_from_bends,
)
from s2c2a.models.disturbances import Disturbances
from s2c2a.models.forward_model import ForwardModel, Memory
from s2c2a.paper import WORKSPACE_SHARE
from s2c2a.planning import terms
from s2c2a.planning.guides import GUIDES, Detour, Guide, Lead, led
from s2c2a.planning.horizon import Horizon
from s2c2a.planning.motion import Approach, GoalMotion
from s2c2a.planning.outcomes import Outcome, judge, slopes_of
from s2c2a.planning.rest import Rest, gaps_of, rests
from s2c2a.planning.solvers import Adam, Problem, Solver
from s2c2a.planning.terms import (
    TERMS,
    Bends,
    Candidate,
    Configurations,
    Guard,
    GuardedPoints,
    Numbers,
    Situation,
    Term,
)
from s2c2a.plugins.components import CustomComponent, Options, Registry
from s2c2a.printing import short_text
from s2c2a.spaces import POSITION

AXES_WEIGHT = 0.5
"""Weight of axes in `BEST`: 1 deg costs as much as 2 mm on an arm of 0.6 m.

Where an arm cannot reach position and axis, as one that is shorter than its arm file
states, its ends stay near their positions.
"""
SOLVERS: Registry[Solver] = Registry(
    "solver", Solver, {"Adam": Adam, "Horizon": Horizon}
)
AnySolver = Annotated[
    Solver | CustomComponent, SkipValidation, BeforeValidator(SOLVERS.read)
]
AnyTerm = Annotated[Term | CustomComponent, SkipValidation, BeforeValidator(TERMS.read)]
AnyGuide = Annotated[
    Guide | CustomComponent, SkipValidation, BeforeValidator(GUIDES.read)
]


@dataclass(frozen=True)
class PlannerOptions(Options):
    """Solver, terms and guides of a planner.

    In files, each component is a table with its name and parameters, or an `Own`.

    Attributes:
        solver: minimizes the objective.
        terms: of the objective.
        guides: change the goal before the solver runs, one after the other.
        engaged_slopes: whether gradients are those of taut cables that follow their
            motors (`ForwardModel.for_planning`) instead of the true ones.
        on_sphere: whether configurations are kept at unit length and within the bend
            limits. Configurations sensed under sensing coupling have other lengths.
        guard: the points of the arm that avoid obstacles.
    """

    solver: AnySolver
    terms: tuple[AnyTerm, ...]
    guides: tuple[AnyGuide, ...] = ()
    engaged_slopes: bool = False
    on_sphere: bool = True
    guard: Guard = "tip"

    def __post_init__(self):
        """Check that there is a term."""
        if not self.terms:
            raise S2C2AError("the planner has no terms; give at least one")

    def build(self) -> tuple[Solver, tuple[Term, ...], tuple[Guide, ...]]:
        """Solver, terms and guides; imports those given by name.

        Raises:
            S2C2AError: a component is not found, may not be imported, or rejects its
                parameters.
        """
        terms = tuple(TERMS.build(term) for term in self.terms)
        guides = tuple(GUIDES.build(guide) for guide in self.guides)
        return SOLVERS.build(self.solver), terms, guides


PAPER = PlannerOptions(
    Adam(),
    (
        terms.Positions(WORKSPACE_SHARE),
        terms.Axes(),
        terms.Repulsion(WORKSPACE_SHARE),
        terms.Change(),
    ),
)
"""Planner options of the paper."""
BEST = PlannerOptions(
    Horizon(),
    (
        terms.Positions(),
        terms.Axes(AXES_WEIGHT),
        terms.Shape(),
        terms.Evenness(),
        terms.Extrapolation(),
        terms.Limits(),
        terms.Obstacles(),
    ),
    (Detour(),),
    engaged_slopes=True,
)
"""Planner options of the recipe `best`."""


class Expectation(NamedTuple):
    """Prediction of the forward model for a plan.

    Attributes:
        states: predicted [m, 1], shape (modules, 6), base frame.
        predictive_std: standard deviation of the module ends [m], shape
            (modules,); zero if unknown.
        extrapolation: the part of it from extrapolation beyond the data [m].
        horizon: positions of the tip in the next moments [m], base frame, shape
            (moments, 3); None if the solver plans one step.
    """

    states: Float[Array, "modules 6"]
    predictive_std: Float[Array, " modules"]
    extrapolation: Float[Array, ""]
    horizon: Float[Array, "moments 3"] | None

    @classmethod
    def unknown(cls, modules: int, looks_ahead: bool) -> "Expectation":
        """Before the first step."""
        states = jnp.full((modules, 6), jnp.nan, jnp.float32)
        ahead = jnp.full((PREVIEW, 3), jnp.nan, jnp.float32) if looks_ahead else None
        return cls(states, states[:, 0], states[0, 0], ahead)


class Plan(NamedTuple):
    """State of the planner after a control step.

    Attributes:
        configurations: planned, C_0 of the next step, shape (modules, 3), module
            frames.
        bends: the same [rad], shape (modules, 2).
        memory: hysteresis of the forward model, from the estimate.
        disturbances: that the plan counts on, with payload moments; None for none.
        solver: memory of the solver.
        motion: of the goals.
        rest: how slowly the arm moves to a goal that rests; None unless the solver is a
            `Horizon`.
        judged: the outcome of the last step, as an integer.
        expectation: what the forward model predicts; NaN before the first step.
    """

    configurations: Configurations
    bends: Bends
    memory: Memory
    disturbances: Disturbances | None
    solver: Any
    motion: GoalMotion
    rest: Rest | None
    judged: Int[Array, ""]
    expectation: Expectation

    def __repr__(self) -> str:
        """Fields, and shapes of arrays."""
        return short_text(self)

    @property
    def outcome(self) -> Outcome:
        """How the last step was planned; for a single plan, outside compiled code."""
        return Outcome(int(self.judged))


class Step(NamedTuple):
    """One control step of planning; a pytree, so that compiled programs are shared.

    Attributes:
        arm: its limits hold.
        model: predicts states.
        solver: minimizes the objective.
        terms: of the objective.
        options: the planner options.
        approach: to goals that jump.
    """

    arm: ArmSpec
    model: ForwardModel
    solver: Solver
    terms: tuple[Term, ...]
    options: PlannerOptions
    approach: Approach

    @classmethod
    def of(
        cls,
        arm: ArmSpec,
        model: ForwardModel,
        options: PlannerOptions,
        factors: ModalFactors | None = None,
    ) -> "Step":
        """The step with these options; arguments as of `Planner`.

        Raises:
            S2C2AError: a component that they name is not found.
        """
        solver, built, _guides = options.build()
        margins = [term.margin for term in built if isinstance(term, terms.Obstacles)]
        kept = margins[0] * arm.length + arm.modules[-1].radius if margins else None
        approach = Approach.of(arm, factors or ModalFactors.nominal())
        return cls(arm, model, solver, built, options, approach._replace(margin=kept))

    def started(
        self,
        sensed: Configurations,
        disturbances: Disturbances | None = None,
        hysteresis: Memory = None,
    ) -> Plan:
        """The plan of an arm at rest; arguments as in `next_plan`."""
        memory = self.model.start(sensed) if hysteresis is None else hysteresis
        if disturbances is not None:
            if disturbances.moments is None:
                disturbances = self.model.settled(disturbances, sensed, memory)
            disturbances = self.model.with_gains(disturbances, sensed, memory)
        bends = bends_from_configurations(sensed)
        return Plan(
            sensed,
            bends,
            memory,
            disturbances,
            self.solver.start(bends),
            GoalMotion.of(len(sensed)),
            Rest.none(self.arm) if isinstance(self.solver, Horizon) else None,
            jnp.asarray(Outcome.SOLVED, jnp.int32),
            Expectation.unknown(len(sensed), self.solver.looks_ahead),
        )

    def next_plan(
        self,
        plan: Plan,
        sensed: Configurations,
        goal: Goal,
        disturbances: Disturbances | None = None,
        hysteresis: Memory = None,
        lead: Lead | None = None,
        seen: Float[Numbers, "modules 3"] | None = None,
    ) -> Plan:
        """The plan of the next control step.

        Readings and goals that are not finite leave the plan unchanged.

        Args:
            plan: of the last control step.
            sensed: present configurations.
            goal: for the next state.
            disturbances: estimated; None for none.
            hysteresis: of the forward model after the present reading, as estimated;
                None without a state estimator: then the sensed configurations advance
                that of the last plan.
            lead: of a guide; None for none.
            seen: module ends in a new picture (`Estimate`).
        """
        if disturbances is not None and plan.disturbances is not None:
            if disturbances.moments is None:  # the estimator may have computed them
                disturbances = self.model.with_moments(
                    disturbances, sensed, plan.memory, plan.disturbances
                )
            disturbances = self.model.with_gains(disturbances, sensed, plan.memory)
            disturbances = select_if_finite(disturbances, plan.disturbances)
        if hysteresis is None:
            hysteresis = self.model.observe(sensed, plan.memory)
        memory = select_if_finite(hysteresis, plan.memory)
        rest, stride = plan.rest, self.approach.stride
        if rest is not None:
            none = Rest.none(self.arm)
            # beside obstacles, an arm that starts at once swings into them
            gain = none.step * self.arm.control_period / START_TIME
            fastest = terms.largest_bend(jnp.diff(plan.solver.knots, axis=0)) / stride
            is_beside = (jnp.asarray(goal.thresholds) > 0.0).any()
            started = jnp.where(is_beside, fastest + gain, none.step)
            none = none._replace(step=jnp.minimum(none.step, started))
            rest = select(rests(self._near(goal), plan.motion), rest, none)
        last = plan._replace(memory=memory, disturbances=disturbances, rest=rest)
        problem = self._begun(last, goal, lead)
        planned, motion, solver, tips = self.solver.next(problem, plan.solver)
        lengths = ArmGeometry.of(self.arm).lengths
        expectation = Expectation(
            planned.states,
            self.model.predictive_std(planned.configurations, memory),
            planned.extrapolation,
            tips,
        )
        judged = judge(planned, problem.situation, lengths)
        if rest is not None:
            arcs = states_from_bends(planned.bends, lengths)[:, POSITION]
            ends = planned.states[:, POSITION]
            gaps = gaps_of(self.model, ends, seen, goal, arcs)
            ahead = terms.largest_bend(solver.knots[-1] - planned.bends)
            rest = rest.after(ahead, *gaps, planned.bends, goal, self.arm, stride)
            judged = jnp.where(rest.is_overloaded, Outcome.OVERLOADED, judged)
        # a target that stays in an obstacle is out of reach
        passes = motion.passes & (motion.step[self.arm.module_count - 1] != 0.0).any()
        judged = jnp.where(passes & (judged > Outcome.SOLVED), Outcome.PASSING, judged)
        new = {
            "configurations": planned.configurations,
            "bends": planned.bends,
            "solver": solver,
            "motion": motion,
            "rest": rest,
            "judged": judged.astype(jnp.int32),
            "expectation": expectation,
        }
        old = {name: getattr(plan, name) for name in new}
        # a model need not know its uncertainty
        is_sound = all_finite((planned.configurations, solver, motion))
        return last._replace(**select(is_sound, new, old))

    def problem(self, last: Plan, goal: Goal, lead: Lead | None = None) -> Problem:
        """The problem of the solver: the goals to which a guide leads."""
        return self._begun(last, goal, lead).started()

    def _begun(self, last: Plan, goal: Goal, lead: Lead | None) -> Problem:
        """The problem before the last plan is predicted."""
        geometry = ArmGeometry.of(self.arm)
        bends = bends_from_configurations(last.configurations)
        configurations = last.configurations
        if geometry.steerable is not None:
            bends = commanded_part(bends, geometry.steerable)
            configurations = configurations_from_bends(bends)
        longest = last.rest.step if last.rest else geometry.step_limit
        situation = Situation(
            goal,
            Candidate(configurations, bends, *[None] * 3),  # type: ignore[arg-type]
            self.arm.length,
            jnp.asarray(geometry.planned_bends, dtype=jnp.float32),
            longest,
            self.options.on_sphere,
            self._guarded.radii,
            steerable=geometry.steerable,
        )
        begun = Problem(
            situation,
            self.terms,
            self._predictor(last),
            self.model.observe,
            last.memory,
            self.approach.stride,
            last.motion,
            lambda candidate: self._completed(begun, candidate, last, lead),
        )
        return begun

    def _completed(
        self, begun: Problem, candidate: Candidate, last: Plan, lead: Lead | None
    ) -> Problem:
        """The problem once the last plan is predicted."""
        situation = begun.situation._replace(last=candidate)
        goal = situation.goal
        load = last.disturbances.payload if last.disturbances else 0.0
        motion, ahead = last.motion.after(
            self._near(goal), candidate.states, self.approach, load
        )
        if last.rest is not None:
            ahead = last.rest.led(ahead)
        tip = candidate.states[-1, POSITION]
        if self.approach.margin is not None:
            lengths = ArmGeometry.of(self.arm).lengths
            slopes = slopes_of(candidate.bends, lengths, situation.longest_step)[:, -1]
            if situation.steerable is not None:
                slopes = slopes.T.reshape(3, -1, 2)
                slopes = commanded_part(slopes, situation.steerable).reshape(3, -1).T
            motion, ahead = motion.beside(ahead, tip, slopes.T @ slopes, self.approach)
        if lead is not None:
            ahead = led(ahead, lead, tip)
            is_led = jnp.asarray(lead.weight) > 0.0
            motion = motion._replace(passes=motion.passes & ~is_led)
            goal = select(is_led, jax.tree.map(lambda values: values[0], ahead), goal)
            situation = situation._replace(goal=goal, room=jnp.asarray(lead.room))
        return begun._replace(situation=situation, motion=motion, ahead=ahead)

    def _near(self, goal: Goal) -> Goal:
        """A goal from whose targets, far beyond the arm, no plan swings from side to side."""
        reach = np.cumsum(ArmGeometry.of(self.arm).lengths)
        told, axes = jnp.split(jnp.asarray(goal.preview), 2, axis=-1)
        preview = jnp.concatenate([limit_lengths(told, reach), axes], axis=-1)
        positions = limit_lengths(goal.positions, reach)
        return goal._replace(positions=positions, preview=preview)  # type: ignore[arg-type]

    @property
    def _guarded(self) -> GuardedPoints:
        return GuardedPoints.of(self.arm, self.options.guard)

    def _predictor(
        self, last: Plan
    ) -> Callable[[Configurations, Bends, Memory], Candidate]:
        engaged = self.options.engaged_slopes
        model = self.model.for_planning() if engaged else self.model
        model = model.near(last.configurations, last.memory)
        points_of = self._guarded
        projectors = ArmGeometry.of(self.arm).steerable

        def predict(
            configurations: Configurations, bends: Bends, memory: Memory
        ) -> Candidate:
            if projectors is not None:
                bends = _with_slopes(bends, commanded_part(bends, projectors))
                commanded = commanded_configurations(configurations, projectors)
                configurations = _with_slopes(configurations, commanded)
            states = model.predict(configurations, memory, last.disturbances)
            if last.rest is not None:
                states = states.at[:, POSITION].add(last.rest.missed)
            points = points_of(states)
            extrapolation = model.extrapolation(configurations)
            return Candidate(configurations, bends, states, points, extrapolation)

        return predict


class Planner:
    """Plans the next configuration online, one control step at a time.

    Compiles at the first call. Targets, obstacles and weights may change in each call.

    Attributes:
        model: predicts states.
        step: what is compiled.
    """

    def __init__(
        self,
        arm: ArmSpec,
        model: ForwardModel,
        options: PlannerOptions,
        factors: ModalFactors | None = None,
    ):
        """A planner of an arm with a forward model.

        Args:
            arm: its limits hold.
            model: predicts states.
            options: solver, terms and guides.
            factors: of the arm's stiffness and damping; nominal ones by default.
        """
        self.model = model
        self.step = step = Step.of(arm, model, options, factors)
        _, _, guides = options.build()
        self._leaders = [guide.leader(arm, model, options.guard) for guide in guides]
        self._no_lead = Lead.none(arm.module_count)
        self._start = compiled(Step.started, step)
        self._next = compiled(Step.next_plan, step)

    def start(self, estimate: Estimate) -> Plan:
        """The plan of an arm at rest: the estimated configurations.

        Args:
            estimate: of the arm's state.

        Raises:
            TargetError: a configuration is not finite.
        """
        if not np.isfinite(estimate.configuration).all():
            raise TargetError(
                "the estimated configurations are not finite; read the sensors again"
            )
        for leader in self._leaders:
            leader.reset()
        configuration = _single(estimate.configuration)
        return self._start(configuration, estimate.disturbances, estimate.hysteresis)

    def plan(self, plan: Plan, estimate: Estimate, goal: Goal) -> Plan:
        """The next plan.

        A configuration or hysteresis that is not finite is ignored, since it would stay
        in the plan.

        Args:
            plan: the last plan.
            estimate: of the arm's state.
            goal: for the next state.
        """
        configuration = _single(estimate.configuration)
        lead = self._lead(plan, goal)
        known = configuration, goal, estimate.disturbances, estimate.hysteresis
        planned = self._next(plan, *known, lead, estimate.seen)
        verdicts = [leader.verdict for leader in self._leaders if leader.verdict]
        if verdicts and planned.outcome is not Outcome.SOLVED:
            return planned._replace(judged=np.asarray(verdicts[0], np.int32))
        return planned

    def set_real_time(self, is_real: bool) -> None:
        """Let guides search beside the control steps; in simulations, a step waits.

        In real time everything compiles here.
        """
        for leader in self._leaders:
            leader.set_real_time(is_real)

    def _lead(self, plan: Plan, goal: Goal) -> Lead:
        """Where the first guide that leads, leads to."""
        bends = np.asarray(plan.bends)
        leads = (leader.lead(bends, goal, plan.outcome) for leader in self._leaders)
        return next((lead for lead in leads if lead is not None), self._no_lead)


def _with_slopes(values: Numbers, slopes: Array) -> Array:
    """The values, exactly, with the slopes of others that equal them up to rounding.

    A term such as `Change` has a kink at the last plan: rounding there would decide the
    direction of its slope.
    """
    constant = jax.lax.stop_gradient(jnp.asarray(values))
    return constant + (slopes - jax.lax.stop_gradient(slopes))


def _single(values: Numbers) -> Numbers:
    return values if isinstance(values, jax.Array) else np.asarray(values, np.float32)
