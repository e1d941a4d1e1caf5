"""Guides: what may change a goal before the terms see it, above all the way round obstacles.

Two obstacles side by side hold a tip that only looks one step ahead. So a coarse map of
the workspace is made once, the arm bent everywhere alike, in a grid over the disc of
full bend. In every control step nodes within an obstacle's threshold and margin are
crossed out, shortest ways from all others to the target are found at once (Bellman and
Ford's sweeps over the grid), and the tip is drawn along its way instead of straight at
the target.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.goals import Goal
from s2c2a.kinematics import ForwardModel, configurations_from_bends, limit_lengths
from s2c2a.components import Kind, Part
from s2c2a.planning.terms import FAR, Guard, Situation, guarded_points, norm
from s2c2a.compilation import compiled
from s2c2a.spaces import POSITION

SIDE = 45  # nodes along the grid
SWEEPS = 64
STEPS_AHEAD = 4  # nodes
NEAR = 0.1  # of the arm's length: how far off the map the tip may be
LOOKAHEAD = 0.1  # of the arm's length, along a way round
NEIGHBORS = tuple((x, y) for x in (-1, 0, 1) for y in (-1, 0, 1) if (x, y) != (0, 0))
SAMPLES = 16  # on the straight way
SHAPE_STEP_DEG = 2.0  # of every module and step, towards a node of the map

Nodes = Float[Array, "side side"]
Point = Float[Array, "3"]
Length = Float[Array, ""] | float


@dataclass(frozen=True)
class Guide(Part, ABC):
    """Changes what is asked in a control step, such as a target that cannot be gone to straight."""

    @abstractmethod
    def prepared(self, arm: ArmSpec, model: ForwardModel, guard: Guard) -> Any:
        """What it has to know of an arm, worked out once: a pytree, None if nothing."""

    @abstractmethod
    def lead(self, situation: Situation, prepared: Any) -> Situation:
        """The situation with another goal, or another shape to lead to."""


@dataclass(frozen=True)
class Pull(Guide):
    """Draws targets nearer that are far away: from there they pull no less, and steps stay those that the data hold.

    Attributes:
        per_radian: way to a target for a radian of the step limit, in parts of the
            arm's length.
    """

    per_radian: float = 0.5013  # 0.035 at 4 deg

    def prepared(self, arm: ArmSpec, model: ForwardModel, guard: Guard) -> None:
        """Nothing."""

    def lead(self, situation: Situation, prepared: None) -> Situation:
        """All targets at most so far from where the module ends are."""
        goal = situation.goal
        now = situation.last.states[:, POSITION]
        way = goal.positions - now
        longest = self.per_radian * situation.longest_step * situation.length
        shares = jnp.minimum(1.0, longest / jnp.maximum(norm(way), 1e-6))
        goal = goal._replace(positions=now + way * shares[:, None])  # type: ignore[arg-type]
        return situation._replace(goal=goal)


class WorkspaceMap(NamedTuple):
    """Where the arm bent everywhere alike can bring its tip.

    Attributes:
        length: of the arm [m].
        bends: of every node [rad], shape (side, side, modules, 2).
        tips: tip of every node [m], shape (side, side, 3).
        points: guarded points of every node [m], shape (side, side, points, 3).
        ways: length of the tip's way to each of eight neighbors [m]; far where there
            is none, shape (8, side, side).
    """

    length: Float[Array, ""]
    bends: Float[Array, "side side modules 2"]
    tips: Float[Array, "side side 3"]
    points: Float[Array, "side side points 3"]
    ways: Float[Array, "neighbors side side"]


class Drawn(NamedTuple):
    """Where the tip is drawn.

    Attributes:
        position: [m], shape (3,).
        bends: of the node there [rad], shape (modules, 2).
        on_the_map: one where the way goes along the map, so that bends are desired too:
            from another shape that reaches as far, the next node can be out of reach by
            small steps; else zero.
    """

    position: Float[Array, "3"]
    bends: Float[Array, "modules 2"]
    on_the_map: Float[Array, ""]


@dataclass(frozen=True)
class Detour(Guide):
    """Draws the tip along a way round obstacles, where they stand between it and its target.

    Attributes:
        margin: kept around obstacles beyond their thresholds, in parts of the arm's
            length.
        longest: a longer way is not taken, in parts of the arm's length; the tip then
            waits before the obstacles. With zero none is looked for, and no map is
            made.
    """

    margin: float = 0.04
    longest: float = 0.8

    def prepared(
        self, arm: ArmSpec, model: ForwardModel, guard: Guard
    ) -> WorkspaceMap | None:
        """The map, made at once: made when obstacles first come, it would compile in a control step."""
        return workspace_map(arm, model, guard) if self.longest else None

    def lead(self, situation: Situation, prepared: WorkspaceMap | None) -> Situation:
        """The tip's target moved to a point of the way, and the shape of the map there asked for."""
        goal = situation.goal
        last = situation.last
        if prepared is None or not len(goal.thresholds):
            return situation

        def along() -> Drawn:
            margin = self.margin * prepared.length
            longest = self.longest * prepared.length
            return drawn_along(
                prepared,
                last.states[-1, POSITION],
                goal.positions[-1],
                goal,
                margin,
                longest,
            )

        needed = (goal.position_weights[-1] > 0.0) & (goal.thresholds > 0.0).any()
        drawn = jax.lax.cond(
            needed, along, lambda: Drawn(goal.positions[-1], last.bends, jnp.zeros(()))
        )
        positions = jnp.asarray(goal.positions).at[-1].set(drawn.position)
        shape = last.bends + limit_lengths(
            drawn.bends - last.bends, np.deg2rad(SHAPE_STEP_DEG)
        )
        goal = goal._replace(positions=positions)  # type: ignore[arg-type]
        return situation._replace(goal=goal, shape=shape, led=drawn.on_the_map)


def workspace_map(arm: ArmSpec, model: ForwardModel, guard: Guard) -> WorkspaceMap:
    """Predict the states of all nodes, at rest."""
    shares = np.linspace(-1.0, 1.0, SIDE)
    grid = np.stack(np.meshgrid(shares, shares, indexing="ij"), axis=-1)
    return compiled(_mapped, arm, model, guard)(np.asarray(grid, np.float32))


def _mapped(
    arm: ArmSpec, model: ForwardModel, guard: Guard, grid: Float[Array, "side side 2"]
) -> WorkspaceMap:
    limits = jnp.asarray(ArmGeometry.of(arm).planned_bends, dtype=jnp.float32)
    bends = grid[:, :, None, :] * limits[:, None]  # (side, side, modules, 2)

    def states(bend):
        configurations = configurations_from_bends(bend)
        return model.predict(configurations, model.start(configurations))

    every = jax.vmap(jax.vmap(states))(bends)
    tips = every[..., -1, POSITION]
    exists = jnp.linalg.norm(grid, axis=-1) <= 1.0 + 1e-6

    def way(step: tuple[int, int]) -> Nodes:
        there = exists & _shifted(exists, step, False)
        return jnp.where(
            there, jnp.linalg.norm(_shifted(tips, step, 0.0) - tips, axis=-1), FAR
        )

    points = jax.vmap(jax.vmap(guarded_points(arm, guard)))(every)
    return WorkspaceMap(
        jnp.asarray(arm.length),
        bends,
        tips,
        points,
        jnp.stack([way(step) for step in NEIGHBORS]),
    )


def drawn_along(
    workspace: WorkspaceMap,
    tip: Point,
    target: Point,
    goal: Goal,
    margin: Length,
    longest: Length,
) -> Drawn:
    """The target where the straight way is free, else a point of the way there, or the tip itself if it is too long.

    Args:
        workspace: of the arm.
        tip: where it is [m].
        target: where it shall go [m].
        goal: its obstacles.
        margin: kept around them [m].
        longest: a longer way is not taken [m].
    """
    spheres = _Spheres.of(goal, margin)
    blocked = spheres.meet(workspace.points)
    return jax.lax.cond(
        _straight_is_blocked(workspace, tip, target, spheres, blocked),
        lambda: _on_the_map(workspace, tip, target, spheres, blocked, longest),
        lambda: Drawn(target, workspace.bends[0, 0], jnp.zeros(())),
    )


def _on_the_map(
    workspace: WorkspaceMap, tip, target, spheres: "_Spheres", blocked, longest: Length
) -> Drawn:
    """A point of the way, the tip where the way is too long, the target where the tip is off the map."""
    to_go, following = _ways_to(workspace, target, blocked)
    apart = jnp.linalg.norm(workspace.tips - tip, axis=-1)
    seen = (apart < NEAR * workspace.length) & ~spheres.meet(
        (workspace.tips + tip)[:, :, None] / 2
    )
    begins = jnp.where(seen, to_go + apart, FAR)
    start = jnp.unravel_index(jnp.argmin(begins), begins.shape)
    along = begins[start] <= longest
    node = _ahead(workspace, tip, start, following)
    otherwise = jnp.where(begins[start] < FAR, tip, target)
    return Drawn(
        jnp.where(along, workspace.tips[node], otherwise),
        workspace.bends[node],
        along.astype(jnp.float32),
    )


class _Spheres(NamedTuple):
    """Obstacles with their margins.

    Attributes:
        centers: [m], shape (obstacles, 3).
        reach: radius [m], not positive where there is no obstacle, shape (obstacles,).
        used: how many of the array have to be looked at.
    """

    centers: Float[Array, "obstacles 3"]
    reach: Float[Array, " obstacles"]
    used: Array

    @classmethod
    def of(cls, goal: Goal, margin: Length) -> "_Spheres":
        there = goal.thresholds > 0.0
        last = jnp.max(jnp.where(there, jnp.arange(len(there)) + 1, 0))
        return cls(
            jnp.asarray(goal.obstacles),
            jnp.where(there, goal.thresholds + margin, 0.0),
            last,
        )

    def meet(self, points: Float[Array, "*places points 3"]) -> Bool[Array, "*places"]:
        """Whether any of a place's points lies within any of them; time goes with the number in use."""

        def one_more(number, met):
            squared = jnp.sum((points - self.centers[number]) ** 2, axis=-1)
            return met | (squared < self.reach[number] ** 2).any(axis=-1)

        return jax.lax.fori_loop(
            0, self.used, one_more, jnp.zeros(points.shape[:-2], dtype=bool)
        )


def _ways_to(
    workspace: WorkspaceMap, target, blocked: Bool[Array, "side side"]
) -> tuple[Nodes, Array]:
    """Length of every node's way to the free node nearest to the target, and which neighbor comes next on it."""
    missing = jnp.linalg.norm(workspace.tips - target, axis=-1)
    off = blocked | (workspace.ways.min(axis=0) >= FAR)
    apart = jnp.where(off, FAR, missing)
    first = jnp.where(apart == apart.min(), missing, FAR)

    def onward(to_go: Nodes) -> Float[Array, "neighbors side side"]:
        return workspace.ways + jnp.stack(
            [_shifted(to_go, step, FAR) for step in NEIGHBORS]
        )

    def sweep(_, to_go: Nodes) -> Nodes:
        return jnp.where(off, FAR, jnp.minimum(to_go, onward(to_go).min(axis=0)))

    to_go = jax.lax.fori_loop(0, SWEEPS, sweep, first)
    # the last one stays
    following = jnp.where(
        first < FAR, len(NEIGHBORS), jnp.argmin(onward(to_go), axis=0)
    )
    return to_go, following


def _ahead(workspace: WorkspaceMap, tip, start, following) -> tuple[Array, Array]:
    """The first node of the way that is so far from the tip, or the last one looked at."""
    steps = jnp.array([*NEIGHBORS, (0, 0)])

    def on(_, node):
        near = (
            jnp.linalg.norm(workspace.tips[node] - tip) < LOOKAHEAD * workspace.length
        )
        step = jnp.where(near, steps[following[node]], 0)
        return node[0] + step[0], node[1] + step[1]

    return jax.lax.fori_loop(0, STEPS_AHEAD, on, start)


def _straight_is_blocked(
    workspace: WorkspaceMap, tip, target, spheres: _Spheres, blocked
) -> Bool[Array, ""]:
    """Whether the tip, or the arm in the shape of the nearest node, meets an obstacle on the straight way."""
    shares = jnp.linspace(0.0, 1.0, SAMPLES + 1)[1:, None]
    samples = tip + (target - tip) * shares
    met = spheres.meet(samples[:, None]).any()
    if workspace.points.shape[-2] == 1:
        return met
    apart = jnp.linalg.norm(workspace.tips.reshape(-1, 3) - samples[:, None], axis=-1)
    return met | blocked.reshape(-1)[jnp.argmin(apart, axis=-1)].any()


def _shifted(values: Array, step: tuple[int, int], beyond) -> Array:
    """Values of the neighbor that lies one step on; `beyond` outside the grid."""
    padded = jnp.pad(
        values, [(1, 1), (1, 1), *[(0, 0)] * (values.ndim - 2)], constant_values=beyond
    )
    row = 1 + step[0]
    column = 1 + step[1]
    return padded[row : row + SIDE, column : column + SIDE]


GUIDES = Kind.of("guide", Guide, Detour, Pull)
