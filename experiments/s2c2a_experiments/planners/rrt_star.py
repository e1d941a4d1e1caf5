"""Rapidly exploring random trees in bends: [22BM] of Table I.

Where a straight change of all bends leads freely to a shape that reaches the target, the
arm makes it, and a target that moves slowly moves that shape alone. Otherwise the arm
holds still while a tree of shapes, whose edges keep the guarded points out of obstacles,
grows over several control steps toward random samples and shapes that reach the target.
RRT* chooses parents, and chooses them anew, by the length of the way from the root
(Karaman and Frazzoli, Int. J. Robotics Research 30, 2011); the arm then follows the
shortest way and leaves out what it can.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Bool, Float, Int

from s2c2a.arm import ArmSpec
from s2c2a.goals import Goal
from s2c2a.planning import Guard
from s2c2a.plugins.components import Ranges
from s2c2a_experiments.planners.arc_driver import TINY, BendPlanning, Bends, Moment
from s2c2a_experiments.planners.arc_solutions import ArcSolutions, Batch

ENDS = 8  # shapes that reach the target
BATCH = 16  # samples whose edges are checked in one call
EDGE_POINTS = 8  # checked on an edge: half a step limit apart
WAY_POINTS = 24  # on a straight way: a step limit apart where it crosses all limits
REACH = 4.0  # step limits; length of an edge to a sample
NEAR = 1.5  # of that length: edges to neighbors
LARGEST_TREE = 1500  # nodes
OLDEST_TREE = 50  # control steps
CLEAR = 0.5  # of the margin: solutions may lie that much within it
TOLERANCE = 0.05  # of 0.4 arm lengths; ends that reach so much worse are none
COST_OF_ERROR = 20.0  # rad; for 0.4 arm lengths
JUMP = 0.1  # of the arm's length, or rad: a target, or obstacle, is a new one
FIXED_SEED = 0

Numbers = Int[np.ndarray, " rows"]
Errors = Float[np.ndarray, " ends"]
Shares = Float[np.ndarray, " shapes"]
Flags = Bool[np.ndarray, " shapes"]


@dataclass(frozen=True)
class RRTStar(BendPlanning):
    """Straight changes of bends, or ways through a random tree around obstacles.

    Attributes:
        samples: of the tree in a control step.
        neighbors: of a sample, which may become its parent or its children.
        waiting: control steps for which a tree grows at least.
        goal_share: of the samples that are shapes at the target.
        margin: around obstacles, in parts of the arm's length.
        pace: largest step, in parts of the step limit.
    """

    samples: int = 32
    neighbors: int = 8
    waiting: int = 5
    goal_share: float = 0.15
    margin: float = 0.04
    pace: float = 0.8
    name = "rrt-star"
    supports = frozenset({"guard"})
    limits: ClassVar[Ranges] = {
        "samples": (1, 500),
        "neighbors": (1, 64),
        "waiting": (1, 100),
        "goal_share": (0.0, 1.0),
        "margin": (0.0, 1.0),
        "pace": (0.01, 1.0),
    }

    def planner(self, arm: ArmSpec, guard: Guard) -> "TreePlanner":
        solver = ArcSolutions(arm, guard, self.margin)
        return TreePlanner(solver, self)


@dataclass(frozen=True)
class RRT(RRTStar):
    """The first way that a tree finds, whose nodes keep the parents nearest to them."""

    neighbors: int = 1
    waiting: int = 1
    name = "rrt"


class Tree:
    """Shapes and the edges between them; node 0 is the root.

    Attributes:
        nodes: [rad], shape (nodes, modules, 2).
        totals: lengths of the ways from the root [rad], shape (nodes,).
        ends: number of the shape at the target that a node is, or -1, shape (nodes,).
        age: control steps for which it has grown.
    """

    def __init__(self, root: Bends):
        """Plant."""
        self.nodes = root[None]
        self.totals = np.zeros(1)
        self.ends = np.full(1, -1)
        self.age = 0
        self._parents = np.zeros(1, int)
        self._lengths = np.zeros(1)

    def nearest(self, shapes: Batch, count: int) -> Int[np.ndarray, "shapes count"]:
        """Nearest nodes, in order; the last one again where there are too few."""
        distances = distances_between(shapes, self.nodes)
        order = np.argsort(distances, axis=1)
        last = len(self.nodes) - 1
        ranks = np.minimum(np.arange(count), last)
        return order[:, ranks]

    def connect(
        self,
        shape: Bends,
        end: int,
        neighbors: Numbers,
        is_free: Bool[np.ndarray, " neighbors"],
    ) -> None:
        """Add a shape below its best neighbor, and the others below it if that is shorter.

        Args:
            shape: [rad].
            end: see `ends`.
            neighbors: nodes.
            is_free: whether the edges to them are.
        """
        if not is_free.any():
            return
        free = neighbors[is_free]
        lengths = distances_between(shape[None], self.nodes[free])[0]
        totals_before = self.totals[free]
        totals = totals_before + lengths
        best = int(totals.argmin())
        total = totals[best]
        gains = total + lengths < totals_before - TINY
        children = free[gains]
        self._parents[children] = len(self.nodes)
        self._lengths[children] = lengths[gains]
        self.nodes = np.concatenate([self.nodes, shape[None]])
        self.totals = np.append(self.totals, total)
        self.ends = np.append(self.ends, end)
        self._parents = np.append(self._parents, free[best])
        self._lengths = np.append(self._lengths, lengths[best])

    def measure(self) -> None:
        """Add up the lengths again, after nodes got other parents.

        Until then they are too large, never less than those of parents: no loop can form.
        """
        totals = self._lengths.copy()
        above = self._parents
        while above.any():
            totals = totals + totals[above]
            above = above[above]
        self.totals = totals

    def forget_ends(self, ends: Numbers) -> None:
        """Ends that are other shapes now."""
        is_other = np.isin(self.ends, ends)
        self.ends[is_other] = -1

    def way_to(self, node: int) -> Batch:
        """Shapes from below the root to a node."""
        way = []
        while node:
            way.append(self.nodes[node])
            node = int(self._parents[node])
        return np.array(way[::-1])


class TreePlanner:
    """The way that the arm follows, and the tree while there is none."""

    def __init__(self, solver: ArcSolutions, options: RRTStar):
        """Compile the solver."""
        self._solver = solver
        self._options = options
        self._reach = REACH * solver.step_limit
        self._clear = CLEAR * solver.margin  # and less to leave an obstacle, see `_aim`
        solver.warm_up(ENDS, ENDS + 1)
        edges = BATCH * options.neighbors
        solver.warm_up(ENDS, ENDS * WAY_POINTS)
        solver.warm_up(ENDS, edges * EDGE_POINTS)
        self._spread = solver.spread(1024)
        self._goal: Goal | None
        self._scene: Goal
        self._ends: Batch
        self._errors: Errors
        self._chosen: int
        self._way: Batch
        self._tree: Tree | None

    def start(self, moment: Moment) -> None:
        """Begin with an arm at rest."""
        self._random = np.random.default_rng(FIXED_SEED)
        self._goal = None
        self._begin(moment.bends, moment.bends)

    def next_bends(self, moment: Moment, goal: Goal) -> Bends:
        """Along the way, or hold still while there is none."""
        last = moment.bends
        if not goal.has_target:
            self._goal = None
            return last
        self._aim(last, goal)
        self._way = self._shortened(last, goal)
        if not len(self._way):
            self._search(last, goal)
        if len(self._way):
            last = self._solver.step(last, self._way[0], self._options.pace)
        return self._solver.outside(last, goal)

    def _aim(self, last: Bends, goal: Goal) -> None:
        """Move the shapes at the target along with it, or find others after a jump."""
        length = self._solver.length
        if self._goal is None or jumps(self._goal, goal, length):
            self._begin(last, self._ends[self._chosen])
            self._scene = goal
        elif obstacles_move(self._scene, goal, length):
            self._tree = None
            self._scene = goal
        self._goal = goal
        # other starts for ends that were of no use; whole arms need many
        is_useless = ~np.isfinite(self._errors)
        useless = np.flatnonzero(is_useless)
        starts = self._spread_shapes(len(useless))
        self._ends = np.array(self._ends)
        self._ends[useless] = starts
        if self._tree:
            self._tree.forget_ends(useless)
        solved = self._solver.solve(self._ends, goal)
        self._ends = solved.bends
        shapes = np.concatenate([self._ends, last[None]])
        gaps = self._solver.clearances(shapes, goal)
        gap_of_last = gaps[-1]
        self._needed = min(self._clear, gap_of_last)
        self._errors = self._of_usable_ends(solved.errors, gaps[:-1])
        is_usable = np.isfinite(self._errors)
        if not is_usable[self._chosen]:
            self._way = self._way[:0]
        if len(self._way):
            self._way[-1] = self._ends[self._chosen]

    def _of_usable_ends(self, errors: Errors, gaps: Errors) -> Errors:
        """Errors; infinite for ends that are not clear, or much worse than others."""
        is_clear = gaps >= self._clear
        errors = np.where(is_clear, errors, np.inf)
        bound = errors.min() + TOLERANCE
        return np.where(errors <= bound, errors, np.inf)

    def _begin(self, last: Bends, end: Bends) -> None:
        """Forget way and tree."""
        known = [last, end]
        others = self._spread_shapes(ENDS - len(known))
        self._ends = np.concatenate([known, others])
        self._errors = np.zeros(ENDS)
        self._chosen = 0
        self._way = np.empty((0, *last.shape))
        self._tree = None

    def _spread_shapes(self, count: int) -> Batch:
        """Random shapes within the limits."""
        rows = self._random.integers(len(self._spread), size=count)
        return self._spread[rows]

    def _shortened(self, last: Bends, goal: Goal) -> Batch:
        """The way from the farthest part that is in straight reach; empty if none is."""
        count = min(len(self._way), ENDS)
        if not count:
            return self._way
        farthest = count - 1
        numbers = np.minimum(np.arange(ENDS), farthest)
        ahead = self._way[numbers]
        is_reached = self._are_free(last, ahead, goal)[:count]
        if not is_reached.any():
            return self._way[:0]
        reached = np.flatnonzero(is_reached)
        first = int(reached.max())
        if first == farthest:
            return self._way[first:]
        following = np.roll(ahead, -1, axis=0)
        is_linked = self._are_free(ahead, following, goal)
        is_linked = is_linked[first:farthest]
        if not is_linked.all():
            return self._way[:0]
        return self._way[first:]

    def _are_free(
        self,
        starts: Float[np.ndarray, "*#shapes modules 2"],
        shapes: Batch,
        goal: Goal,
    ) -> Flags:
        """Whether the straight ways to shapes keep clear of obstacles."""
        gaps = self._solver.way_clearances(starts, shapes, goal, WAY_POINTS)
        return gaps >= self._needed

    def _search(self, last: Bends, goal: Goal) -> None:
        """Straight to the best end, or through the tree."""
        ways = distances_between(last[None], self._ends)[0]
        is_free = self._are_free(last, self._ends, goal)
        costs = COST_OF_ERROR * self._errors + ways
        costs = np.where(is_free, costs, np.inf)
        is_usable = np.isfinite(self._errors)
        best = int(costs.argmin())
        if np.isfinite(costs[best]):
            way = self._ends[best][None]
            self._follow(way, best)
        elif is_usable.any():
            self._search_tree(last, goal)

    def _follow(self, way: Batch, end: int) -> None:
        self._way = np.array(way)
        self._chosen = end
        self._tree = None

    def _search_tree(self, last: Bends, goal: Goal) -> None:
        """Grow the tree; then follow the shortest way to an end.

        A full or old tree without one leads to its node nearest to an end.
        """
        if self._tree is None:
            self._tree = Tree(last)
        tree = self._tree
        is_usable = np.isfinite(self._errors)
        wanted = np.flatnonzero(is_usable)
        for _ in range(0, self._options.samples, BATCH):
            self._grow(tree, wanted, goal)
        tree.age += 1
        errors = self._errors[tree.ends]
        costs = tree.totals + COST_OF_ERROR * errors
        is_end = tree.ends >= 0
        costs = np.where(is_end, costs, np.inf)
        best = int(costs.argmin())
        has_end = np.isfinite(costs[best])
        is_full = len(tree.nodes) > LARGEST_TREE
        if has_end and tree.age >= self._options.waiting:
            end = int(tree.ends[best])
            self._follow(tree.way_to(best), end)
        elif is_full or tree.age >= OLDEST_TREE:
            self._follow_near(tree, wanted)

    def _follow_near(self, tree: Tree, wanted: Numbers) -> None:
        """As near to an end as the tree came."""
        gaps = distances_between(tree.nodes, self._ends[wanted])
        nearest = gaps.argmin()
        node, number = np.unravel_index(nearest, gaps.shape)
        end = int(wanted[number])
        shapes = tree.way_to(int(node))
        way = np.array([*shapes, self._ends[end]])
        self._follow(way, end)

    def _grow(self, tree: Tree, wanted: Numbers, goal: Goal) -> None:
        """Add a batch of samples, or what of the ways to them is within reach."""
        samples, ends = self._samples(wanted)
        shapes, shares, is_new = self._within_reach(tree, samples)
        ends = np.where(shares == 1.0, ends, -1)
        neighbors = tree.nearest(shapes, self._options.neighbors)
        # edges to neighbors that are short and keep clear of obstacles
        nodes = tree.nodes[neighbors]
        changes = nodes - shapes[:, None]
        lengths = np.linalg.norm(changes, axis=(2, 3))
        is_short = lengths <= NEAR * self._reach
        count = neighbors.shape[1]
        tops = np.repeat(shapes, count, axis=0)
        bottoms = nodes.reshape(tops.shape)
        gaps = self._solver.way_clearances(bottoms, tops, goal, EDGE_POINTS)
        gaps = gaps.reshape(neighbors.shape)
        is_clear = gaps >= self._needed
        is_free = is_clear & is_short
        for number in np.flatnonzero(is_new):
            end = int(ends[number])
            tree.connect(shapes[number], end, neighbors[number], is_free[number])
        tree.measure()

    def _within_reach(self, tree: Tree, samples: Batch) -> tuple[Batch, Shares, Flags]:
        """Shapes on the ways from the tree, shares of the ways, and which are new."""
        numbers = tree.nearest(samples, 1)[:, 0]
        nearest = tree.nodes[numbers]
        changes = samples - nearest
        sizes = np.linalg.norm(changes, axis=(1, 2))
        is_new = sizes > TINY
        sizes = np.maximum(sizes, TINY)
        shares = np.minimum(1.0, self._reach / sizes)
        steps = shares[:, None, None] * changes
        return nearest + steps, shares, is_new

    def _samples(self, wanted: Numbers) -> tuple[Batch, Numbers]:
        """Shapes, and which end each is, or -1."""
        spread = self._spread_shapes(BATCH)
        numbers = self._random.integers(len(wanted), size=BATCH)
        ends = wanted[numbers]
        draws = self._random.random(BATCH)
        is_end = draws < self._options.goal_share
        end_shapes = self._ends[ends]
        shapes = np.where(is_end[:, None, None], end_shapes, spread)
        ends = np.where(is_end, ends, -1)
        return shapes, ends


def distances_between(first: Batch, second: Batch) -> Float[np.ndarray, "first second"]:
    """Distances of shapes [rad]."""
    changes = first[:, None] - second
    return np.linalg.norm(changes, axis=(2, 3))


def jumps(before: Goal, now: Goal, length: float) -> bool:
    """Whether targets are not those before, moved a little.

    Args:
        before: goal.
        now: goal.
        length: of the arm [m].
    """
    if not np.array_equal(before.position_weights, now.position_weights):
        return True
    if not np.array_equal(before.axis_weights, now.axis_weights):
        return True
    ways = now.desired_positions() - before.desired_positions()
    turns = now.desired_axes() - before.desired_axes()
    changes = np.stack([ways / length, turns])
    changes = np.nan_to_num(changes)
    largest = np.linalg.norm(changes, axis=-1).max()
    return bool(largest > JUMP)


def obstacles_move(before: Goal, now: Goal, length: float) -> bool:
    """Whether obstacles are not those before, moved a little."""
    rows_before = before.obstacles_in_use()
    rows_now = now.obstacles_in_use()
    if rows_before.shape != rows_now.shape:
        return True
    changes = np.abs(rows_now - rows_before)
    largest = changes.max(initial=0.0)
    return bool(largest > JUMP * length)
