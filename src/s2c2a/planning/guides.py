"""Guides: change a goal before the solver runs, such as paths around obstacles.

Two obstacles side by side block a tip that plans a second ahead. The `Detour` guide
therefore uses a coarse map of the workspace, computed once: a grid over the disc of
full bend, with all modules bent alike. In every control step it removes nodes within an
obstacle's threshold and margin, finds the shortest paths from all other nodes to the
target at once (Bellman-Ford sweeps over the grid), and places the target of the tip on
its path.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.compilation import compiled
from s2c2a.components import Component, Registry
from s2c2a.goals import Goal, preview_stride
from s2c2a.kinematics import configurations_from_bends, limit_lengths
from s2c2a.kinematics.bends import Numbers
from s2c2a.models.forward_model import ForwardModel
from s2c2a.planning.terms import FAR, Guard, Situation, guarded_points
from s2c2a.spaces import POSITION

SIDE = 45  # nodes along each side of the grid
SWEEPS = 64
NODES_AHEAD = 4
NEAR = 0.1  # of the arm's length: largest distance of the tip from the map
LOOKAHEAD = 0.1  # of the arm's length, along the path
SAMPLES = 16  # on the straight path
# of the way of a straight arm that turns at its base by the step limit in each control
# step up to the next knot. With all of it, the tip overshoots into obstacles by 3 cm
ADVANCE = 0.5
SHAPE_STEP_DEG = 2.0  # per module and step, towards the bends of a node
OFFSETS = (-1, 0, 1)
NEIGHBORS = tuple((x, y) for x in OFFSETS for y in OFFSETS if (x, y) != (0, 0))

Nodes = Float[Array, "side side"]
Point = Float[Numbers, "3"]
Length = Float[Array, ""] | float


@dataclass(frozen=True)
class Guide(Component, ABC):
    """Changes the goal of a control step, such as a target behind an obstacle."""

    @abstractmethod
    def prepare(self, arm: ArmSpec, model: ForwardModel, guard: Guard) -> Any:
        """Data about an arm, computed once: a pytree, None if not needed."""

    @abstractmethod
    def apply(self, situation: Situation, prepared: Any) -> Situation:
        """The situation with another goal, or another desired shape."""


class WorkspaceMap(NamedTuple):
    """Tip positions of the arm with all modules bent alike, on a grid of bends.

    Attributes:
        length: of the arm [m].
        advance: largest distance of the tip from its target on the map [m].
        bends: of every node [rad], shape (side, side, modules, 2).
        tips: tip of every node [m], shape (side, side, 3), base frame.
        points: guarded points of every node [m], shape (side, side, points, 3).
        distances: of the tips of every node and each of its eight neighbors [m]; `FAR`
            where there is none, shape (8, side, side).
    """

    length: Float[Array, ""]
    advance: Float[Array, ""]
    bends: Float[Array, "side side modules 2"]
    tips: Float[Array, "side side 3"]
    points: Float[Array, "side side points 3"]
    distances: Float[Array, "neighbors side side"]


class TipTarget(NamedTuple):
    """Target of the tip on its path.

    Attributes:
        position: [m], shape (3,), base frame.
        bends: of the node there [rad], shape (modules, 2).
        on_map: one if the path follows the map, else zero. The bends are then desired
            too: from another shape with the same tip, small steps may not reach the
            next node.
    """

    position: Point
    bends: Float[Array, "modules 2"]
    on_map: Float[Array, ""]


@dataclass(frozen=True)
class Detour(Guide):
    """Moves the target of the tip along a path around obstacles.

    Attributes:
        margin: distance from obstacles beyond their thresholds, in parts of the arm's
            length.
        longest: longest path, in parts of the arm's length; with a longer one the tip
            waits before the obstacles. With zero the guide does nothing.
    """

    margin: float = 0.04
    longest: float = 0.8

    def prepare(
        self, arm: ArmSpec, model: ForwardModel, guard: Guard
    ) -> WorkspaceMap | None:
        """The map; at the first obstacle it would compile within a control step."""
        if not self.longest:
            return None
        return workspace_map(arm, model, guard)

    def apply(self, situation: Situation, prepared: WorkspaceMap | None) -> Situation:
        """The situation with a point of the path as target, and the shape there."""
        goal = situation.goal
        last = situation.last
        if prepared is None or not len(goal.thresholds):
            return situation

        def follow_path() -> TipTarget:
            tip = last.states[-1, POSITION]
            target = tip_target(
                prepared,
                tip=tip,
                target=goal.positions[-1],
                goal=goal,
                margin=self.margin * prepared.length,
                longest=self.longest * prepared.length,
            )
            way = limit_lengths(target.position - tip, prepared.advance)
            is_limited = (target.on_map > 0.0) & (way != target.position - tip).any()
            position = jnp.where(is_limited, tip + way, target.position)
            return target._replace(position=position)

        def go_straight() -> TipTarget:
            return TipTarget(goal.positions[-1], last.bends, jnp.zeros(()))

        needed = (goal.position_weights[-1] > 0.0) & (goal.thresholds > 0.0).any()
        target = jax.lax.cond(needed, follow_path, go_straight)
        positions = jnp.asarray(goal.positions).at[-1].set(target.position)
        step = limit_lengths(target.bends - last.bends, np.deg2rad(SHAPE_STEP_DEG))
        return situation._replace(
            goal=goal._replace(positions=positions),  # type: ignore[arg-type]
            shape=last.bends + step,
            shape_weight=target.on_map,
        )


def workspace_map(arm: ArmSpec, model: ForwardModel, guard: Guard) -> WorkspaceMap:
    """Predict the states of all nodes, at rest."""
    shares = np.linspace(-1.0, 1.0, SIDE)
    grid = np.stack(np.meshgrid(shares, shares, indexing="ij"), axis=-1)
    return compiled(_map_grid, arm, model, guard)(np.asarray(grid, np.float32))


def _map_grid(
    arm: ArmSpec, model: ForwardModel, guard: Guard, grid: Float[Array, "side side 2"]
) -> WorkspaceMap:
    limits = jnp.asarray(ArmGeometry.of(arm).planned_bends, dtype=jnp.float32)
    bends = grid[:, :, None, :] * limits[:, None]  # (side, side, modules, 2)

    def predict(bends):
        configurations = configurations_from_bends(bends)
        return model.predict(configurations, model.start(configurations))

    states = jax.vmap(jax.vmap(predict))(bends)
    tips = states[..., -1, POSITION]
    points = jax.vmap(jax.vmap(guarded_points(arm, guard)))(states)
    exists = jnp.linalg.norm(grid, axis=-1) <= 1.0 + 1e-6
    distances = []
    for offset in NEIGHBORS:
        connected = exists & _neighbors(exists, offset, outside=False)
        edges = _neighbors(tips, offset, outside=0.0) - tips
        distances.append(jnp.where(connected, jnp.linalg.norm(edges, axis=-1), FAR))
    knot_turn = preview_stride(arm.control_period) * ArmGeometry.of(arm).step_limit
    return WorkspaceMap(
        jnp.asarray(arm.length),
        jnp.asarray(ADVANCE * knot_turn * arm.length),
        bends,
        tips,
        points,
        jnp.stack(distances),
    )


def tip_target(
    workspace: WorkspaceMap,
    tip: Point,
    target: Point,
    goal: Goal,
    margin: Length,
    longest: Length,
) -> TipTarget:
    """Next target of the tip on its path around obstacles.

    Args:
        workspace: of the arm.
        tip: position of the tip [m], base frame.
        target: its target [m], base frame.
        goal: holds the obstacles.
        margin: distance from obstacles [m].
        longest: longest path [m].

    Returns:
        The target if the straight path is free, else a point of the path, or the tip
        itself if the path is too long.
    """
    spheres = _Spheres.of(goal, margin)
    blocked = spheres.contain(workspace.points)
    return jax.lax.cond(
        _is_straight_path_blocked(workspace, tip, target, spheres, blocked),
        lambda: _target_on_map(workspace, tip, target, spheres, blocked, longest),
        lambda: TipTarget(target, workspace.bends[0, 0], jnp.zeros(())),
    )


def _target_on_map(
    workspace: WorkspaceMap, tip, target, spheres: "_Spheres", blocked, longest: Length
) -> TipTarget:
    """A point of the path; the tip if the path is too long, the target off the map."""
    remaining, following = _shortest_paths(workspace, target, blocked)
    distances = jnp.linalg.norm(workspace.tips - tip, axis=-1)
    midpoints = (workspace.tips + tip)[:, :, None] / 2
    is_near = distances < NEAR * workspace.length
    visible = is_near & ~spheres.contain(midpoints)
    lengths = jnp.where(visible, remaining + distances, FAR)
    start = jnp.unravel_index(jnp.argmin(lengths), lengths.shape)
    short = lengths[start] <= longest
    node = _node_ahead(workspace, tip, start, following)
    otherwise = jnp.where(lengths[start] < FAR, tip, target)
    position = jnp.where(short, workspace.tips[node], otherwise)
    return TipTarget(position, workspace.bends[node], short.astype(jnp.float32))


class _Spheres(NamedTuple):
    """Obstacles with their margins.

    Attributes:
        centers: [m], shape (obstacles, 3), base frame.
        radii: [m], zero for unused rows, shape (obstacles,).
        used: number of rows up to the last obstacle.
    """

    centers: Float[Array, "obstacles 3"]
    radii: Float[Array, " obstacles"]
    used: Array

    @classmethod
    def of(cls, goal: Goal, margin: Length) -> "_Spheres":
        """The obstacles of a goal."""
        exists = goal.thresholds > 0.0
        used = jnp.max(jnp.where(exists, jnp.arange(len(exists)) + 1, 0))
        radii = jnp.where(exists, goal.thresholds + margin, 0.0)
        return cls(jnp.asarray(goal.obstacles), radii, used)

    def contain(
        self, points: Float[Array, "*places points 3"]
    ) -> Bool[Array, "*places"]:
        """Whether any point of each place is inside; the time grows with `used`."""

        def add_sphere(number, inside):
            squared = jnp.sum((points - self.centers[number]) ** 2, axis=-1)
            return inside | (squared < self.radii[number] ** 2).any(axis=-1)

        nowhere = jnp.zeros(points.shape[:-2], dtype=bool)
        return jax.lax.fori_loop(0, self.used, add_sphere, nowhere)


def _shortest_paths(
    workspace: WorkspaceMap, target, blocked: Bool[Array, "side side"]
) -> tuple[Nodes, Array]:
    """Length of each node's path to the free node nearest to the target.

    Also the number of the neighbor that follows on it.
    """
    distances = jnp.linalg.norm(workspace.tips - target, axis=-1)
    excluded = blocked | (workspace.distances.min(axis=0) >= FAR)
    free_distances = jnp.where(excluded, FAR, distances)
    is_end = free_distances == free_distances.min()
    initial = jnp.where(is_end, distances, FAR)

    def through_neighbors(remaining: Nodes) -> Float[Array, "neighbors side side"]:
        onward = [_neighbors(remaining, offset, FAR) for offset in NEIGHBORS]
        return workspace.distances + jnp.stack(onward)

    def sweep(_, remaining: Nodes) -> Nodes:
        shortest = through_neighbors(remaining).min(axis=0)
        return jnp.where(excluded, FAR, jnp.minimum(remaining, shortest))

    remaining = jax.lax.fori_loop(0, SWEEPS, sweep, initial)
    following = jnp.argmin(through_neighbors(remaining), axis=0)
    stay = len(NEIGHBORS)
    return remaining, jnp.where(initial < FAR, stay, following)


def _node_ahead(workspace: WorkspaceMap, tip, start, following) -> tuple[Array, Array]:
    """The first node of the path beyond the lookahead, at most `NODES_AHEAD` on."""
    offsets = jnp.array([*NEIGHBORS, (0, 0)])
    lookahead = LOOKAHEAD * workspace.length

    def advance(_, node):
        near = jnp.linalg.norm(workspace.tips[node] - tip) < lookahead
        offset = jnp.where(near, offsets[following[node]], 0)
        return node[0] + offset[0], node[1] + offset[1]

    return jax.lax.fori_loop(0, NODES_AHEAD, advance, start)


def _is_straight_path_blocked(
    workspace: WorkspaceMap, tip, target, spheres: _Spheres, blocked
) -> Bool[Array, ""]:
    """Whether the tip hits an obstacle on the straight path, or the arm near it.

    The shape of the arm is that of the nearest node.
    """
    shares = jnp.linspace(0.0, 1.0, SAMPLES + 1)[1:, None]
    samples = tip + (target - tip) * shares
    tip_hits = spheres.contain(samples[:, None]).any()
    if workspace.points.shape[-2] == 1:
        return tip_hits
    tips = workspace.tips.reshape(-1, 3)
    distances = jnp.linalg.norm(tips - samples[:, None], axis=-1)
    nearest = jnp.argmin(distances, axis=-1)
    return tip_hits | blocked.reshape(-1)[nearest].any()


def _neighbors(values: Array, offset: tuple[int, int], outside) -> Array:
    """Values of each node's neighbor at an offset; `outside` beyond the grid."""
    widths = [(1, 1), (1, 1), *[(0, 0)] * (values.ndim - 2)]
    padded = jnp.pad(values, widths, constant_values=outside)
    row, column = np.add(offset, 1)
    return padded[row : row + SIDE, column : column + SIDE]


GUIDES: Registry[Guide] = Registry("guide", Guide, {"Detour": Detour})
