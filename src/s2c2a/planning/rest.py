"""How an arm comes to rest on a goal that rests.

A plan follows what is estimated, and estimates follow the arm that the plan moves. With
backlash, a load that the model does not know, or beyond what the arm can carry, the two
can sway for ever. So commands to a goal that rests change slowly, which shakes neither the
arm nor the trust in its sensors: in a window of time by as much as the gap that sensors
see is worth, and by less where that has not narrowed it. Where the gap is small, they do
not change: friction makes an arm jump to and fro that is moved ever on.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.execution.compilation import select
from s2c2a.goals import PREVIEW, Goal
from s2c2a.kinematics import limit_lengths
from s2c2a.kinematics.bends import Numbers, Scalar, Truth
from s2c2a.models.forward_model import ForwardModel
from s2c2a.planning.motion import GoalMotion
from s2c2a.planning.outcomes import STILL
from s2c2a.planning.terms import Bends

# chosen on held points of `twin_arm` and three randomized arms, under up to 100 g
THERE = 0.003
"""Of the arm's length: commands rest at a gap that is smaller, or all but twice as large."""
FALL = 0.15  # of the smallest gap so far: a smaller fall has not helped
CALM = 0.02  # of the arm's length: a window whose ends vary more has a sway
# of the arm's length: an arm that is farther from its goal, and from where cables alone
# would hold it, in two windows, is overloaded. Of 36 held points of three randomized arms
# (0 to 150 g), toppled ones are beyond 0.42 of their goal, and others within 0.24, but for
# one that cables alone would have held nearby
FALLEN = 0.3


class Rest(NamedTuple):
    """How slowly an arm moves to a goal that rests, and what it saw in this window.

    Attributes:
        step: longest change of a module's bend in a control step [rad].
        trust: in commands: share of the gap that they may take; doubled by each window
            that narrows the smallest gap, halved by each in which the arm moved another
            way.
        fresh: trust in commands to a gap that is new; halved by each, so that no fast
            sway goes on for ever; regained in time, or at the goal.
        is_slow: whether the goal rests, and the plan has arrived or had its time.
        smallest: gap in a window so far, since something has changed [m].
        before: gap in the last window [m].
        missed: how far from the model's prediction ends are seen [m], as bends do not
            explain all of it; limited, since cameras err, too.
        gaps: sums of the gaps between ends and goal, and ends and prediction, in this
            window [m].
        squares: sums of squares of gaps from the goal, and from arcs [m2].
        judged: number of them.
        steps: of this window.
        fallen: windows since the arm has fallen.
        calm: bends at which it came to rest since then [rad]; zero before that.
    """

    step: Scalar
    trust: Scalar
    fresh: Scalar
    is_slow: Truth
    smallest: Scalar
    before: Float[Array, "modules 3"]
    missed: Float[Array, "modules 3"]
    gaps: Float[Array, "2 modules 3"]
    squares: Float[Array, "2"]
    judged: Int[Array, ""]
    steps: Int[Array, ""]
    fallen: Int[Array, ""]
    calm: Bends

    @classmethod
    def none(cls, arm: ArmSpec) -> "Rest":
        """Of an arm that follows its goal."""
        limit = jnp.asarray(ArmGeometry.of(arm).step_limit, jnp.float32)
        gap = jnp.zeros((arm.module_count, 3))
        one, zero = jnp.ones(()), jnp.zeros((), jnp.int32)
        known = one, one, zero > 0, one * jnp.inf, gap, gap
        window = jnp.stack([gap, gap]), jnp.zeros(2), zero, zero
        return cls(limit, *known, *window, zero, gap[:, :2])

    @property
    def is_overloaded(self) -> Truth:
        """Whether the arm has fallen from this goal, and goes to where it is calm."""
        return self.fallen > 1

    def after(
        self,
        ahead: Scalar,
        gaps: Float[Array, "3 modules 3"],
        is_measured: Truth,
        bends: Bends,
        goal: Goal,
        arm: ArmSpec,
        stride: int,
    ) -> "Rest":
        """After another control step to a goal that rests.

        Args:
            ahead: largest change of a module's bend to the end of the horizon [rad].
            gaps: of ends from goal, prediction and arcs (`gaps_of`) [m].
            is_measured: whether they count in the mean of this window; in one without
                such gaps, the last one counts.
            bends: that are planned [rad].
            goal: that rests; a straight arm to the farthest end with a goal is the lever
                of steps, and they go on where a direction is desired, which is not seen.
            arm: its limits hold.
            stride: control steps between two moments of a preview.
        """
        none = Rest.none(arm)
        slow = STILL * none.step
        window = 2 * PREVIEW * stride  # longer than the slowest vibration
        is_last = (self.judged == 0) & (self.steps + 1 >= window)
        is_judged = is_measured | is_last
        judged = jnp.where(is_judged, gaps, 0.0)
        arrived = ahead < PREVIEW * stride * slow  # slow steps do not hold the plan up
        is_slow = self.is_slow | arrived | (self.steps >= window)
        now = self._replace(
            step=jnp.where(is_slow & ~self.is_slow, slow, self.step),
            is_slow=is_slow,
            gaps=self.gaps + judged[:2],
            squares=self.squares + jnp.sum(judged[::2] ** 2, axis=(1, 2)),
            judged=self.judged + is_judged,
            steps=self.steps + 1,
        )
        squares = now.squares / now.judged
        mean, missed = now.gaps / now.judged
        gap = jnp.linalg.norm(mean)
        is_calm = squares[0] - gap**2 < (CALM * arm.length) ** 2
        there = THERE * arm.length
        # by more than its friction: it was pushed, creeps, or carries something else
        is_new = gap > 2.0 * jnp.maximum(self.smallest, there)
        is_new |= jnp.isinf(self.smallest)
        narrows = gap < (1.0 - FALL) * self.smallest
        # in its direction, within 60 deg: backlash takes up commands that move nothing
        stays = jnp.sum(mean * self.before) > 0.5 * gap * jnp.linalg.norm(self.before)
        change = jnp.where(narrows, 2.0, jnp.where(stays, 1.0, 0.5))
        trust = jnp.minimum(change * self.trust, self.fresh)
        trust = jnp.maximum(jnp.where(is_new, self.fresh, trust), STILL)
        comes_back = is_new & jnp.isfinite(self.smallest)
        fresh = jnp.where(comes_back, 0.5, 1.0 + FALL) * self.fresh
        least = STILL**2 * slow
        reaches = np.cumsum(ArmGeometry.of(arm).lengths)
        reach = jnp.max((goal.position_weights > 0.0) * reaches)
        step = trust * gap / (reach * now.steps)
        rested = (gap < there) | ((self.step < least) & ~is_new)
        rested &= ~(jnp.asarray(goal.axis_weights) > 0.0).any()
        step = jnp.where(rested, STILL * least, jnp.clip(step, least, slow))
        lies = (squares > (FALLEN * arm.length) ** 2).all()
        is_away = self.is_overloaded & ~(squares[0] <= (CALM * arm.length) ** 2)
        fallen = jnp.where(lies | is_away, self.fallen + 1, 0)
        # it goes to rest, or to where it is calm before that
        calm = jnp.where(self.is_overloaded, self.calm, none.calm)
        later = none._replace(
            step=jnp.where(fallen > 1, slow, step),
            trust=trust,
            fresh=jnp.where(gap < there, 1.0, jnp.minimum(fresh, 1.0)),
            is_slow=is_slow,
            smallest=jnp.where(is_new, gap, jnp.minimum(self.smallest, gap)),
            before=mean,
            # pictures are late: those of an arm that approaches or is pushed say nothing
            missed=limit_lengths(self.missed + ~is_new * missed, CALM * arm.length),
            fallen=fallen,
            calm=jnp.where(is_calm & ~lies, bends, calm),
        )
        return select(is_slow & (now.steps >= window), later, now)

    def led(self, ahead: Goal) -> Goal:
        """Goals of the next moments; an overloaded arm goes to where it is calm."""
        wanted = 1.0 - self.is_overloaded
        changed: dict[str, Any] = {
            "position_weights": wanted * ahead.position_weights,
            "axis_weights": wanted * ahead.axis_weights,
            "shape": jnp.where(self.is_overloaded, self.calm, ahead.shape),
            "shape_weight": jnp.maximum(self.is_overloaded, ahead.shape_weight),
        }
        return ahead._replace(**changed)


def gaps_of(
    model: ForwardModel,
    ends: Float[Array, "modules 3"],
    seen: Float[Numbers, "modules 3"] | None,
    goal: Goal,
    arcs: Float[Array, "modules 3"],
) -> tuple[Float[Array, "3 modules 3"], Truth]:
    """Gaps of ends from goal, prediction and arcs [m], and whether they were measured.

    Args:
        model: that predicts the ends.
        ends: as predicted [m].
        seen: in a new picture [m]; where it is NaN, and without a camera (None), the
            prediction counts.
        goal: for the next state; gaps of ends that it leaves free are zero.
        arcs: ends of the arm as arcs without a load, base frame [m].
    """
    seen = ends if seen is None else seen
    is_new = jnp.isfinite(seen)
    expected, ends = ends, jnp.where(is_new, seen, ends)
    is_desired = jnp.asarray(goal.position_weights)[:, None] > 0.0
    gaps = [ends - goal.positions, ends - expected, model.to_base(ends) - arcs]
    return jnp.where(is_desired, jnp.stack(gaps), 0.0), is_new.any()


def rests(goal: Goal, before: GoalMotion) -> Truth:
    """Whether a goal of positions, without obstacles, stays as it is, as far as known."""
    same = jnp.concatenate([goal.positions, goal.axes], axis=-1)
    will_move = (goal.preview != same) & ~jnp.isnan(goal.preview)
    moves = ~before.stays(goal) | will_move.any()
    is_desired = jnp.asarray(goal.position_weights > 0.0).any()
    return is_desired & ~moves & ~(jnp.asarray(goal.thresholds) > 0.0).any()
