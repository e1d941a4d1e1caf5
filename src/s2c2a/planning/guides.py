"""Guides: lead the plan where the horizon alone does not find the way.

A plan of a second sees no way around what blocks its goal. `Detour` searches a way of
the whole arm (`ways.Roadmap`) beside the control loop, and leads the plan along it.
"""

from abc import ABC, abstractmethod
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.goals import PREVIEW, START_TIME, Goal, Scalar, preview_stride
from s2c2a.kinematics.bends import Numbers
from s2c2a.models.forward_model import ForwardModel
from s2c2a.planning.outcomes import SIGNIFICANT, Outcome
from s2c2a.planning.terms import Guard
from s2c2a.planning.ways import Roadmap, Shape, Way
from s2c2a.plugins.components import Component, Registry
from s2c2a.spaces import POSITION

ADVANCE = 0.3  # of the step limit; chosen: at 0.5 arms vibrate into obstacles
MOVED = 0.03  # of the arm's length: another target or obstacle, which needs another way
SEARCH_TIME = 0.3  # s; a result is taken then, or later where no step may wait for it
ELSEWHERE = np.deg2rad(10.0)  # from where a search began, another way may be found
OBSTACLES = ("obstacles", "thresholds", "cores")
CLOSEST = 0.25  # of the margin, kept where there is no more room


class Lead(NamedTuple):
    """Where a guide leads the plan.

    Attributes:
        bends: of the next moments [rad], shape (PREVIEW, modules, 2), module frames.
        tips: positions of the tip then [m], shape (PREVIEW, 3), base frame; NaN where it
            is to stay.
        weight: one if it leads, else zero.
        room: least distance from obstacles then [m]; plans keep no more.
    """

    bends: Float[Numbers, "moments modules 2"]
    tips: Float[Numbers, "moments 3"]
    weight: Scalar
    room: Scalar = np.asarray(np.inf, np.float32)

    @classmethod
    def none(cls, modules: int) -> "Lead":
        """Where no guide leads."""
        bends = np.zeros((PREVIEW, modules, 2), np.float32)
        return cls(bends, np.zeros((PREVIEW, 3), np.float32), np.zeros((), np.float32))


class Leader(ABC):
    """A guide of one arm, with what it remembers from step to step.

    Attributes:
        verdict: why no way leads to the goal, as far as it knows; None without a reason.
        waits: whether `lead` waits for a search that takes long; a simulation does, so
            that its results do not depend on the computer.
    """

    verdict: Outcome | None = None
    waits = True

    @abstractmethod
    def lead(self, bends: Shape, goal: Goal, outcome: Outcome) -> Lead | None:
        """Where the plan is led; None if it needs no guide.

        Args:
            bends: of the last plan [rad], shape (modules, 2).
            goal: for the next state.
            outcome: of the last plan.
        """

    @abstractmethod
    def set_real_time(self, is_real: bool) -> None:
        """Set `waits`; in real time, compile everything before the arm moves."""

    @abstractmethod
    def reset(self) -> None:
        """Forget an earlier run."""


@dataclass(frozen=True)
class Guide(Component, ABC):
    """Leads plans, such as around obstacles."""

    @abstractmethod
    def leader(self, arm: ArmSpec, model: ForwardModel, guard: Guard) -> Leader:
        """The guide of an arm.

        Args:
            arm: its limits hold.
            model: predicts states.
            guard: the points that keep clear of obstacles.
        """


@dataclass(frozen=True)
class Detour(Guide):
    """Leads the plan along a free way where it does not reach its goal by itself.

    Attributes:
        margin: distance from obstacles beyond their thresholds, in parts of the arm's
            length. A way through a narrow passage has a quarter of it.
        longest: way of the tip, in parts of the arm's length; with a longer one the arm
            waits before the obstacles. With zero the guide does nothing.
    """

    margin: float = 0.04
    longest: float = 2.0

    def leader(self, arm: ArmSpec, model: ForwardModel, guard: Guard) -> Leader:
        return WayLeader(arm, model, guard, self)


class Search(NamedTuple):
    """A search that was begun.

    Attributes:
        start: bends from which the way leads [rad].
        goal: to which.
        result: the way; None if there is none.
        steps: control steps since it was begun.
    """

    start: Shape
    goal: Goal
    result: "Future[Way | None]"
    steps: int = 0


class WayLeader(Leader):
    """Searches ways beside the control loop, and leads the plan along them."""

    def __init__(
        self, arm: ArmSpec, model: ForwardModel, guard: Guard, options: Detour
    ):
        """Compute nothing yet."""
        geometry = ArmGeometry.of(arm)
        self._stride = preview_stride(arm.control_period)
        self._fastest = ADVANCE * geometry.step_limit
        self._gain = self._fastest * arm.control_period / START_TIME
        self._parts = arm, model, guard
        self._options = options
        self._patience = round(SEARCH_TIME * arm.control_rate)
        self._length = arm.length
        self._margin = options.margin * arm.length
        self._nearly = SIGNIFICANT * arm.length
        self._map: Roadmap | None = None
        self._worker = ThreadPoolExecutor(1, "ways")
        self._search: Search | None = None
        self._latest: Future[Way | None] = self._worker.submit(lambda: None)
        self.reset()

    def reset(self) -> None:
        if self._search is not None:
            self._search.result.cancel()
        self.verdict = None
        self._way: Way | None = None
        self._progress = 0.0
        self._speed = 0.0
        self._search = None
        self._known: Goal | None = None
        self._last: Goal | None = None
        self._stands = False
        self._start: Shape | None = None

    def set_real_time(self, is_real: bool) -> None:
        self.waits = not is_real
        if is_real and self._options.longest and self._map is None:
            self._worker.submit(self._compile).result()

    def _compile(self) -> None:
        """Search past few obstacles and past many; runs in the worker."""
        modules = self._parts[0].module_count
        target = self._length * np.array([0.3, 0.0, 0.9])
        goal = Goal.of(modules).with_position(target)
        for count in (1, len(goal.thresholds)):
            beside = np.tile([2.0 * self._length, 0.0, 0.0], (count, 1))
            scene = goal.with_obstacles(beside, [0.1 * self._length] * count)
            self._searched(np.zeros((modules, 2), np.float32), scene)

    def lead(self, bends: Shape, goal: Goal, outcome: Outcome) -> Lead | None:
        if not (self._options.longest and _needs_ways(goal)):
            self.reset()
            return None
        last, self._last = self._last, goal
        is_elsewhere = last is None or self._differs(goal, last, ("positions",))
        moves = self._moves(goal, goal if last is None or is_elsewhere else last)
        if moves and (self._way is None or self.verdict is Outcome.BLOCKED):
            # the tip passes the obstacles (`GoalMotion.beside`)
            self._way, self.verdict = None, None
            self._search, self._stands = None, False
            return None
        self._take_result()
        known = self._known
        if known is not None and self._have_moved(goal, known):
            # obstacles that are faster than searches are left to the horizon
            self._way, self.verdict = None, None
        is_new = known is None or self._differs(goal, known, ("positions", *OBSTACLES))
        needs = outcome is not Outcome.SOLVED or self._way is not None
        self._stands |= is_elsewhere and not moves
        if self._way is None and self._start is not None:
            # far from where the last search began
            is_new |= bool(np.abs(bends - self._start).max() > ELSEWHERE)
        if self._search is None and (needs or self._stands) and is_new:
            self._begin_search(bends, goal)
        self._stands &= self._search is not None
        return self._along(bends)

    def _moves(self, goal: Goal, last: Goal) -> bool:
        """Whether the target of the tip moves on, by its preview, or with equal steps."""
        step = goal.positions[-1] - last.positions[-1]
        known = goal.preview[:, -1, POSITION] - goal.positions[-1]
        ways = np.where(np.isnan(known), PREVIEW * self._stride * step, known)
        return bool((np.abs(ways) > MOVED * self._length).any())

    def _begin_search(self, bends: Shape, goal: Goal) -> None:
        """Begin a search, but after an earlier one that nobody waits for any more."""
        if not (self.waits or self._latest.done()):
            return
        wait([self._latest])
        self._latest = self._worker.submit(self._searched, bends, goal)
        self._search = Search(bends, goal, self._latest)
        self._start = bends

    def _searched(self, bends: Shape, goal: Goal) -> Way | None:
        """See `Search.result`; runs in the worker."""
        if self._map is None:
            self._map = Roadmap(*self._parts)
        least = CLOSEST * self._margin
        way = self._map.find(bends, goal, least, self._margin)
        longest = self._options.longest * self._length
        return way if way and way.length <= longest else None

    def _take_result(self) -> None:
        search = self._search
        if search is None:
            return
        may_take = self.waits or search.result.done()
        if search.steps < self._patience or not may_take:
            self._search = search._replace(steps=search.steps + 1)
            return
        self._search, self._stands = None, False
        self._known = search.goal
        way = search.result.result()
        self.verdict = self._verdict_on(way)
        if self._way is None:
            self._speed = 0.0
        is_open = way is not None and way.is_straight and way.room.min() > self._margin
        self._way = None if is_open and self.verdict is not Outcome.BLOCKED else way
        self._progress = 0.0

    def _verdict_on(self, way: Way | None) -> Outcome | None:
        """Why a way does not end at the goal; None if it does."""
        if way is None or way.detained > self._nearly:
            return Outcome.BLOCKED
        return Outcome.OUT_OF_REACH if way.miss > self._nearly else None

    def _have_moved(self, goal: Goal, known: Goal) -> bool:
        """Whether obstacles have moved; others may have appeared or gone."""
        are_both = (goal.thresholds > 0.0) & (known.thresholds > 0.0)
        ways = np.abs(goal.obstacles - known.obstacles).max(axis=-1)
        return bool((are_both & (ways > MOVED * self._length)).any())

    def _differs(self, goal: Goal, known: Goal, fields: tuple[str, ...]) -> bool:
        """Whether a field has moved by more than is negligible."""
        changes = [getattr(goal, name) - getattr(known, name) for name in fields]
        largest = max(np.abs(change).max() for change in changes)
        return bool(largest > MOVED * self._length)

    def _along(self, bends: Shape) -> Lead | None:
        """The next moments on the way, from where the plan is; None at its end."""
        if self._way is None:
            if self._search is None or not (self._stands or self._known is None):
                return None
            # the arm stands until the way around what it would meet is found
            nowhere = np.full((PREVIEW, 3), np.nan, np.float32)
            still = np.tile(self._search.start, (PREVIEW, 1, 1)).astype(np.float32)
            return Lead(still, nowhere, np.ones((), np.float32))
        way = self._way
        end = float(way.places[-1])
        reached = self._progress + 4.0 * self._stride * self._fastest
        window = np.linspace(self._progress, reached, 16)
        near, _, _ = way.at(np.minimum(window, end))
        distances = np.linalg.norm(near - bends, axis=(1, 2))
        self._progress = float(window[np.argmin(distances)])
        # an arm that obstacles keep off its goal stays at the end of its way
        if self._progress >= end and self.verdict is not Outcome.BLOCKED:
            self._way = None
            return None
        self._progress = min(self._progress, end)
        ahead = self._progress + self._ways_ahead(end - self._progress)
        shapes, tips, room = (part.astype(np.float32) for part in way.at(ahead))
        return Lead(shapes, tips, np.ones((), np.float32), room.min())

    def _ways_ahead(self, rest: float) -> Float[np.ndarray, " moments"]:
        """How far the next moments are ahead, from the present speed to the end."""
        speed, place, ahead = self._speed, 0.0, []
        for step in range(PREVIEW * self._stride):
            braking = np.sqrt(2.0 * self._gain * max(rest - place, 0.0))
            speed = min(speed + self._gain, self._fastest, braking)
            if step == 0:
                self._speed = speed
            place = min(place + speed, rest)
            ahead.append(place)
        return np.array(ahead[self._stride - 1 :: self._stride])


def _needs_ways(goal: Goal) -> bool:
    """Whether there is an obstacle, and a target of the tip; all finite."""
    has_both = goal.position_weights[-1] > 0.0 and (goal.thresholds > 0.0).any()
    numbers = goal.positions[-1], goal.obstacles, goal.thresholds, goal.cores
    return bool(has_both and all(np.isfinite(values).all() for values in numbers))


def led(ahead: Goal, lead: Lead, tip: Float[Array, "3"]) -> Goal:
    """Goals of the next moments as a guide leads, from a present position of the tip.

    Other targets wait: they would pull against the way.
    """
    leads = jnp.asarray(lead.weight) > 0.0
    positions = jnp.asarray(ahead.positions)
    tips = jnp.where(jnp.isnan(jnp.asarray(lead.tips)), tip, lead.tips)
    tip_alone = jnp.asarray(ahead.position_weights).at[:, :-1].set(0.0)
    of_way = {
        "positions": positions.at[:, -1].set(tips),
        "position_weights": tip_alone,
        "axis_weights": jnp.zeros_like(ahead.axis_weights),
        "shape": jnp.asarray(lead.bends),
        "shape_weight": jnp.ones(len(positions)),
    }
    changed: dict[str, Any] = {
        name: jnp.where(leads, value, getattr(ahead, name))
        for name, value in of_way.items()
    }
    return ahead._replace(**changed)


GUIDES: Registry[Guide] = Registry("guide", Guide, {"Detour": Detour})
