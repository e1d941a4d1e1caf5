"""Ways around obstacles: from one shape of the arm to another, in bends.

The table of shapes that reachability uses is a roadmap: shapes within it that are near to
each other are connected (Kavraki et al., IEEE Trans. Robotics and Automation 12, 1996).
Whether a connection is free of obstacles is found out only for those on the shortest way
so far (Bohlin and Kavraki, ICRA 2000). The way found is cut short, and then improved as
a whole by Gauss-Newton: the way of the tip, its smoothness, and the distance from the
obstacles.
"""

from itertools import pairwise
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from s2c2a.arm import ArmSpec
from s2c2a.arm.geometry import interpolated
from s2c2a.execution.compilation import compiled
from s2c2a.goals import Goal
from s2c2a.kinematics import norm
from s2c2a.models.forward_model import ForwardModel
from s2c2a.obstacles import distances
from s2c2a.planning.reach import BATCH, Reachability, RestingArm, obstacle_rows
from s2c2a.planning.solvers import along_axes
from s2c2a.planning.terms import Bends, Guard, GuardedPoints
from s2c2a.spaces import POSITION

PerShape = Float[np.ndarray, " shapes"]
NodeNumbers = Int[np.ndarray, " nodes"]
# chosen; tests/planning/test_detour.py holds ways short and clear
NEIGHBORS = 12  # of every shape
ENTRIES = 32  # shapes of the table that start and ends are connected with
ENDS = 8  # shapes that reach the target
OUTSIDE = 1e-3  # m; solutions end this far outside of obstacles
MISS_COST = 30.0  # way of the tip that an end nearer by 1 is worth
CHECKED = np.deg2rad(3.0)  # largest bend between two checked shapes of a connection
SEARCHES = 100
EDGES_AT_ONCE = 4096  # checked side by side: more take memory, not less time
PARABOLA = np.array(
    [[0.375, 0.75, -0.125], [0.0, 1.0, 0.0], [-0.125, 0.75, 0.375]], np.float32
)  # places at a quarter, a half and three quarters, from start, middle and end
TURN_LENGTH = 0.05  # of the arm's length: a way of the tip that costs as much as 1 rad
KNOTS = 32  # of an improved way
IMPROVEMENTS = 12  # of Gauss-Newton
LARGEST_STEP = np.deg2rad(4.0)  # of a knot in an improvement
CHANGE, TURN, DEPTH = 0.02, 0.3, 3.0
"""Weights of the bends' changes and turns and of depths in the margin, beside the way of
the tip."""
DAMPING = 1e-4  # of squared slopes near one

Edges = Int[np.ndarray, "edges 2"]
Shape = Float[np.ndarray, "modules 2"]
ShapesOf = Float[np.ndarray, "shapes modules 2"]


class FreeSpace(NamedTuple):
    """The space around obstacles, with the distance to be kept.

    Attributes:
        centers: [m], base frame, shape (obstacles, 3).
        thresholds: with the least distance [m]; zero for unused rows, shape
            (obstacles,).
        cores: see `s2c2a.obstacles`, shape (obstacles, 8).
        radii: of the body around the guarded points [m], shape (points,).
        more: further distance that an improved way keeps where there is room [m].
    """

    centers: Float[np.ndarray, "obstacles 3"]
    thresholds: Float[np.ndarray, " obstacles"]
    cores: Float[np.ndarray, "obstacles 8"]
    radii: Float[np.ndarray, " points"]
    more: Float[np.ndarray, ""]

    @classmethod
    def of(
        cls,
        goal: Goal,
        least: float,
        margin: float,
        radii: Float[np.ndarray, " points"],
    ) -> "FreeSpace":
        """The obstacles of a goal, in one of two numbers of rows."""
        is_used = np.asarray(goal.thresholds) > 0.0
        rows = np.argsort(~is_used, kind="stable")[: obstacle_rows(is_used.sum())]
        used = goal.with_rows(rows)
        kept = np.where(is_used[rows], used.thresholds + least, 0.0)
        thresholds = kept.astype(np.float32)
        more = np.asarray(margin - least, np.float32)
        return cls(used.obstacles, thresholds, used.cores, radii, more)

    def clearances(
        self, points: Float[Array, "*batch points 3"]
    ) -> Float[Array, "*batch points obstacles"]:
        """Distances of the body around points [m]; infinite for unused rows."""
        gaps = distances(points[..., None, :], self.centers, self.cores)
        clear = gaps - self.thresholds - self.radii[:, None]
        return jnp.where(self.thresholds > 0.0, clear, jnp.inf)


class Way(NamedTuple):
    """Shapes on the way, near to each other.

    Attributes:
        bends: [rad], shape (knots, modules, 2), module frames.
        tips: positions of the tip [m], shape (knots, 3), base frame.
        room: distances of the guarded points from the obstacles [m], shape (knots,).
        miss: distance of its end from the target, in which axes count too [m].
        detained: by how much obstacles keep its end farther away [m].
        is_straight: whether it leads straight on, in bends.
    """

    bends: ShapesOf
    tips: Float[np.ndarray, "knots 3"]
    room: Float[np.ndarray, " knots"]
    miss: float
    detained: float
    is_straight: bool

    @property
    def places(self) -> Float[np.ndarray, " knots"]:
        """How far the module that turns the most has turned at every knot [rad]."""
        turns = np.linalg.norm(np.diff(self.bends, axis=0), axis=-1).max(axis=-1)
        return np.concatenate([[0.0], np.cumsum(turns)])

    def at(
        self, wanted: PerShape
    ) -> tuple[ShapesOf, Float[np.ndarray, "shapes 3"], PerShape]:
        """Shapes, tips and room at places between the knots."""
        places = self.places
        parts = self.bends, self.tips, self.room
        bends, tips, room = (interpolated(wanted, places, part) for part in parts)
        return bends, tips, room

    @property
    def length(self) -> float:
        """Way of the tip [m]."""
        return float(np.linalg.norm(np.diff(self.tips, axis=0), axis=1).sum())


class Roadmap:
    """Finds ways of an arm at rest around obstacles, by its forward model."""

    def __init__(self, arm: ArmSpec, model: ForwardModel, guard: Guard):
        """Predict and connect the table of shapes.

        Args:
            arm: its bend limits hold.
            model: predicts states.
            guard: the points that keep clear.
        """
        resting = RestingArm.of(arm, model)
        self._reach = Reachability(arm, model, guard=guard)
        self._length = arm.length
        points_of = GuardedPoints.of(arm, guard)
        self._radii = points_of.radii
        table = self._reach.shapes
        self._bends = np.asarray(table.bends)
        self._tips = np.asarray(table.states)[:, -1, POSITION]
        flat = self._bends.reshape(len(self._bends), -1)
        self._tree = cKDTree(flat)
        _, near = self._tree.query(flat, NEIGHBORS + 1)
        pairs = np.stack(np.broadcast_arrays(near[:, :1], near[:, 1:]), axis=-1)
        self._edges = np.unique(np.sort(pairs.reshape(-1, 2), axis=1), axis=0)
        middles = self._bends[self._edges].mean(axis=1)
        points = jax.vmap(points_of)(table.states)
        between = jax.vmap(points_of)(self._reach.states_of(middles))
        self._screened = compiled(_screened, points, between, self._edges)
        self._observed = compiled(_observed, resting, points_of)
        self._improved = compiled(_improved, resting, points_of)

    def find(self, start: Shape, goal: Goal, least: float, margin: float) -> Way | None:
        """The shortest way that is found, or None.

        Args:
            start: present bends [rad], shape (modules, 2).
            goal: where the way ends; its obstacles.
            least: distance from the obstacles [m].
            margin: distance from them where there is room [m].
        """
        space = FreeSpace.of(goal, least, margin, self._radii)
        ends, misses = self._ends(goal, space, least)
        if not len(ends):
            return None
        is_free, may_connect = map(np.asarray, self._screened(space))
        bends = np.concatenate([self._bends, np.asarray(start, np.float32)[None], ends])
        outer_tips, clear = self._observe(bends[len(self._bends) :], space)
        floor = min(float(clear[0]), 0.0)
        tips = np.concatenate([self._tips, outer_tips])
        edges = self._edges[may_connect]
        entries = self._entries(bends, is_free)
        floors = np.where((entries == len(self._bends)).any(axis=1), floor, 0.0)
        entries = entries[self._free_connections(bends[entries], space, floors)]
        path = self._search(bends, tips, edges, entries, space, misses)
        if path is None:
            return None
        corners = self._cut_short(bends[path], tips[path], space, floor)
        # knots of the improved way, or of that over the corners if it is not free
        dense = resampled(corners, KNOTS)
        improved = np.asarray(self._improved(jnp.asarray(dense, jnp.float32), space))
        pairs = np.stack([improved[:-1], improved[1:]], axis=1)
        knots = improved if self._free_connections(pairs, space).all() else dense
        way_tips, clear = self._observe(knots, space)
        end = path[-1] - len(bends)
        miss = float(misses[end])
        without = goal._replace(thresholds=np.zeros_like(goal.thresholds))
        free = self._reach.solutions(without)
        detained = miss - float(free.misses.min())
        return Way(knots, way_tips, clear + least, miss, detained, len(corners) == 2)

    def _ends(
        self, goal: Goal, space: FreeSpace, least: float
    ) -> tuple[ShapesOf, Float[np.ndarray, " ends"]]:
        """Free shapes near the goal, the nearest first, and their distances from it [m]."""
        exists = np.asarray(goal.thresholds) > 0.0
        radii = np.where(exists, goal.thresholds + least + OUTSIDE, 0.0)
        found = self._reach.solutions(
            goal._replace(thresholds=radii.astype(np.float32))
        )
        _, clearances = self._observe(found.bends, space)
        is_free = clearances > 0.0
        ends, misses = found.bends[is_free], found.misses[is_free]
        order = np.argsort(misses + 1e-3 * np.linalg.norm(ends, axis=(1, 2)))[:ENDS]
        return ends[order], misses[order]

    def _entries(self, bends: ShapesOf, is_free: np.ndarray) -> Edges:
        """Connections of start and ends with the table, and of both."""
        first = len(self._bends)
        outer = np.arange(first, len(bends))
        flat = bends[first:].reshape(len(outer), -1)
        _, near = self._tree.query(flat, 4 * ENTRIES)
        pairs = [np.stack([np.full(len(outer) - 1, first), outer[1:]], axis=1)]
        for number, row in zip(outer, near, strict=True):
            free = row[is_free[row]][:ENTRIES]
            pairs.append(np.stack([np.full(len(free), number), free], axis=1))
        return np.concatenate(pairs)

    def _search(
        self,
        bends: ShapesOf,
        tips: np.ndarray,
        edges: Edges,
        entries: Edges,
        space: FreeSpace,
        misses: Float[np.ndarray, " ends"],
    ) -> NodeNumbers | None:
        """Numbers of the shapes on the shortest free way.

        Connections of the table are checked once they are on the shortest way.
        """
        count = len(bends)
        start = count - len(misses) - 1
        is_checked = np.arange(len(edges) + len(entries)) >= len(edges)
        edges = np.sort(np.concatenate([edges, entries]), axis=1)
        costs = self._costs(bends, tips, edges)
        for _ in range(SEARCHES):
            distances, before = _shortest(costs, edges, count, start)
            last = start + 1 + np.argmin(distances[start + 1 :] + MISS_COST * misses)
            if not np.isfinite(distances[last]):
                return None
            nodes = _nodes(before, int(last))
            steps = np.sort(np.array(list(pairwise(nodes))), axis=1)
            on_way = np.flatnonzero(np.isin(edges @ [count, 1], steps @ [count, 1]))
            unknown = on_way[~is_checked[on_way]]
            if not len(unknown):
                return np.array(nodes)
            is_free = self._free_connections(bends[edges[unknown]], space)
            is_checked[unknown] = True
            costs[unknown[~is_free]] = np.inf
        return None

    def _free_connections(
        self,
        pairs: Float[np.ndarray, "pairs 2 modules 2"],
        space: FreeSpace,
        floors: Float[np.ndarray, " pairs"] | float = 0.0,
    ) -> np.ndarray:
        """Whether each straight connection is free, between its ends too.

        Args:
            pairs: shapes at their ends.
            space: what is free.
            floors: least clearances [m]; below zero where an arm leaves an obstacle.
        """
        largest = np.linalg.norm(pairs[:, 1] - pairs[:, 0], axis=-1).max(axis=-1)
        counts = np.maximum(np.ceil(largest / CHECKED).astype(int), 2)
        shares = [np.arange(1, count) / count for count in counts]
        rows = np.repeat(np.arange(len(pairs)), counts - 1)
        share = np.concatenate(shares)[:, None, None]
        shapes = pairs[rows, 0] + share * (pairs[rows, 1] - pairs[rows, 0])
        _, clearances = self._observe(shapes, space)
        smallest = np.full(len(pairs), np.inf)
        np.minimum.at(smallest, rows, clearances)
        return smallest >= floors

    def _observe(
        self, bends: ShapesOf, space: FreeSpace
    ) -> tuple[Float[np.ndarray, "shapes 3"], PerShape]:
        """Tips, and clearances of the guarded points, of any number of shapes [m]."""
        count = len(bends)
        rows = np.minimum(np.arange(-(-count // BATCH) * BATCH), count - 1)
        calls = np.asarray(bends, np.float32)[rows].reshape(-1, BATCH, *bends.shape[1:])
        found = [self._observed(call, space) for call in calls]
        tips = [np.zeros((0, 3)), *(np.asarray(seen[0]) for seen in found)]
        clearances = [np.zeros(0), *(np.asarray(seen[1]) for seen in found)]
        return np.concatenate(tips)[:count], np.concatenate(clearances)[:count]

    def _cut_short(
        self, bends: ShapesOf, tips: np.ndarray, space: FreeSpace, floor: float
    ) -> ShapesOf:
        """The corners of the shortest way over any of these shapes.

        Args:
            bends: of shapes on a free way.
            tips: of these shapes [m].
            space: what is free.
            floor: least clearance of connections from the start [m].
        """
        count = len(bends)
        pairs = np.stack(np.triu_indices(count, 1), axis=1)
        floors = np.where(pairs[:, 0] == 0, floor, 0.0)
        free = self._free_connections(bends[pairs], space, floors)
        free |= np.diff(pairs, axis=1)[:, 0] == 1
        pairs = pairs[free]
        costs = self._costs(bends, tips, pairs)
        _, before = _shortest(costs, pairs, count, 0)
        return bends[_nodes(before, count - 1)]

    def _costs(
        self, bends: ShapesOf, tips: np.ndarray, edges: Edges
    ) -> Float[np.ndarray, " edges"]:
        """Ways of the tip [m], and as much for turns of the modules."""
        changes = bends[edges[:, 1]] - bends[edges[:, 0]]
        turns = np.linalg.norm(changes, axis=(1, 2))
        ways = np.linalg.norm(np.diff(tips[edges], axis=1), axis=(1, 2))
        return ways + TURN_LENGTH * self._length * turns + np.finfo(np.float32).eps


def _shortest(
    costs: Float[np.ndarray, " edges"], edges: Edges, count: int, start: int
) -> tuple[Float[np.ndarray, " nodes"], NodeNumbers]:
    """Distance of every node from the start, and the node before it."""
    kept = np.isfinite(costs)
    graph = coo_matrix((costs[kept], edges[kept].T), shape=(count, count)).tocsr()
    return dijkstra(graph, directed=False, indices=start, return_predecessors=True)


def _nodes(before: NodeNumbers, last: int) -> list[int]:
    """The nodes on the way to the last one."""
    nodes = [last]
    while before[nodes[-1]] >= 0:
        nodes.append(int(before[nodes[-1]]))
    return nodes[::-1]


def resampled(corners: ShapesOf, count: int) -> ShapesOf:
    """Shapes at equal distances, in bends, on the way over the corners."""
    steps = np.linalg.norm(np.diff(corners, axis=0), axis=(1, 2))
    places = np.concatenate([[0.0], np.cumsum(steps)])
    wanted = np.linspace(0.0, places[-1], count)
    return interpolated(wanted, places, corners)


def _screened(
    points: Float[Array, "nodes points 3"],
    middles: Float[Array, "edges points 3"],
    edges: Int[Array, "edges 2"],
    space: FreeSpace,
) -> tuple[Array, Array]:
    """Nodes that are free, and edges that seem free at three places.

    Between its ends and its middle, points move along parabolas.
    """
    is_free = space.clearances(points).min(axis=(-2, -1)) > 0.0

    def seems_free(edge: tuple[Array, Array]) -> Bool[Array, ""]:
        (a, b), middle = edge
        start, end = points[a], points[b]
        quarters = jnp.asarray(PARABOLA) @ jnp.stack([start, middle, end]).reshape(
            3, -1
        )
        between = quarters.reshape(-1, *middle.shape)
        return is_free[a] & is_free[b] & (space.clearances(between) > 0.0).all()

    return is_free, jax.lax.map(seems_free, (edges, middles), batch_size=EDGES_AT_ONCE)


def _observed(
    arm: RestingArm,
    points_of: GuardedPoints,
    bends: Float[Array, "shapes modules 2"],
    space: FreeSpace,
) -> tuple[Float[Array, "shapes 3"], Float[Array, " shapes"]]:
    """Tips of shapes [m], and the smallest clearances of their guarded points [m]."""
    states = jax.vmap(arm.states)(bends)
    clearances = space.clearances(jax.vmap(points_of)(states))
    return states[:, -1, POSITION], clearances.min(axis=(-2, -1))


def _improved(
    arm: RestingArm,
    points_of: GuardedPoints,
    knots: Float[Array, "knots modules 2"],
    space: FreeSpace,
) -> Float[Array, "knots modules 2"]:
    """The knots after some steps of Gauss-Newton; both ends stay."""
    count = len(knots)
    size = knots[0].size
    length = jnp.sum(jnp.asarray(arm.lengths))
    intervals = count - 1.0
    changes = np.diff(np.eye(count), axis=0) * np.sqrt(intervals)
    turns = np.diff(np.eye(count), 2, axis=0) * intervals**1.5 / count
    smooth = CHANGE**2 * changes.T @ changes
    smooth += TURN**2 * turns.T @ turns / count
    smoothness = np.kron(smooth, np.eye(size)).astype(np.float32)
    is_inner = np.arange(count) % (count - 1) > 0
    inner = np.repeat(is_inner, size).astype(np.float32)
    is_free = np.outer(inner, inner)
    held = np.diag(1.0 - inner + np.float32(DAMPING))

    def seen(bends: Bends) -> Float[Array, " values"]:
        """Tip, and depths of points in the margin around obstacles."""
        states = arm.states(bends)
        gaps = space.clearances(points_of(states)) - space.more
        depths = DEPTH * jnp.minimum(gaps, 0.0) / length
        return jnp.concatenate([states[-1, POSITION] / length, depths.reshape(-1)])

    def improve(_: int, knots: Array) -> Array:
        values, slopes = jax.vmap(lambda bends: along_axes(seen, bends, 1))(knots)
        steps = jnp.einsum("dk,kri->drki", changes, slopes[:, :3])
        steps = steps.reshape(-1, inner.size)
        moved = changes @ values[:, :3]
        depths = values[:, 3:]
        blocks = slopes[:, 3:]
        pushed = jnp.einsum("kri,kr->ki", blocks, depths)
        gradient = steps.T @ moved.reshape(-1)
        gradient += pushed.reshape(-1)
        gradient += smoothness @ knots.reshape(-1)
        own = jnp.einsum("kri,krj->kij", blocks, blocks)
        matrix = steps.T @ steps
        matrix += smoothness
        matrix += jax.scipy.linalg.block_diag(*own)
        solution = jnp.linalg.solve(matrix * is_free + held, gradient * inner)
        step = -solution.reshape(knots.shape)
        largest = jnp.maximum(jnp.max(norm(step)), LARGEST_STEP)
        return arm.within_limits(knots + step * LARGEST_STEP / largest)

    return jax.lax.fori_loop(0, IMPROVEMENTS, improve, knots)
