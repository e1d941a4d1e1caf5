"""Where the time of a plan goes, and how near it is to its floor: its operations at this core's best."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from s2c2a.bench.measurement import Measurement, timing
from s2c2a.bench.operations import Operations, count_operations
from s2c2a.bench.options import BenchOptions
from s2c2a.bench.plan import following, planner_of, straight
from s2c2a.bench.timing import Call, Progress, taken_in_turn
from s2c2a.experiments.workshop import Workshop
from s2c2a.kinematics import ForwardModel
from s2c2a.planning import Goal, LeastSquaresOptions, Plan
from s2c2a.planning.planner import next_plan, solver_of
from s2c2a.programs import compiled
from s2c2a.strategies import TrainedNetworks, recipe_named
from s2c2a.strategies.scale import planning_scale
from s2c2a.tasks import circle

TURNS = 100  # of a piece within one call, so that the call itself does not count
SQUARE = 256  # rows of the matrices whose product says what this core can do


def measure(options: BenchOptions, progress: Progress) -> Iterator[Measurement]:
    """Both recipes: pieces of a plan, each timed alone, and what a plan adds up to."""
    workshop = Workshop(progress=progress)
    repeats = max(1, options.repeats // 5)
    peak = _peak(repeats)
    yield Measurement("this core's matrix products", "Gop/s", peak / 1e9, None, repeats)
    for recipe in ("best", "paper"):
        networks = workshop.networks(options.arm, recipe_named(recipe), options.seed)
        yield from pieces(networks, repeats, peak, partial(progress, f"pieces of a plan, {recipe}"))


def pieces(
    networks: TrainedNetworks, repeats: int, peak: float, progress: Callable[[int, int], None]
) -> Iterator[Measurement]:
    """What one plan is made of.

    Args:
        networks: whose plans.
        repeats: of every timing.
        peak: operations that this core can do in a second.
        progress: told how many repeats of how many are done.
    """
    arm, recipe, model = networks.arm, networks.recipe, networks.c2s
    planner, goals = planner_of(networks), circle(arm).goals
    sensed = jnp.asarray(straight(arm.module_count))
    plan, goal = planner.start(sensed), goals[0]
    look = _look_with_slopes if isinstance(recipe.planner, LeastSquaresOptions) else _look_with_gradient
    variables = 2 * arm.module_count
    calls = {
        "the call alone": _calling(compiled(_nothing), plan, sensed, goal),
        "a look at the model": _turning(_look, model, plan),
        "a look with slopes": _turning(look, model.for_planning(), plan),
        f"{variables} linear equations": _turning(_solve, jnp.eye(variables)),
        "one plan": following(planner, goals),
    }
    times = taken_in_turn(calls, repeats, progress)
    for name, seconds in times.items():
        once = seconds / (1 if name in ("one plan", "the call alone") else TURNS)
        yield timing(f"{name}, {recipe.name}", once)
    solver, parts = solver_of(arm, model, planning_scale(arm), recipe.planner)
    counted = count_operations(partial(next_plan, solver, parts, model), plan, sensed, goal)
    yield from _counts(counted, float(np.median(times["one plan"])), peak, recipe.name)


def _counts(counted: Operations, seconds: float, peak: float, recipe: str) -> Iterator[Measurement]:
    yield Measurement(f"operations of a plan, {recipe}", "Mop", counted.arithmetic / 1e6)
    yield Measurement(f"roots, exponentials and the like, {recipe}", "Mop", counted.transcendental / 1e6)
    yield Measurement(f"bytes through matrix products, {recipe}", "MB", counted.matrix_bytes / 1e6)
    floor = counted.arithmetic / peak
    yield Measurement(f"floor of a plan, {recipe}", "s", floor, note="its operations at this core's best")
    yield Measurement(f"a plan over its floor, {recipe}", "x", seconds / floor)


def _peak(repeats: int) -> float:
    """Operations a second of a product of matrices that fit into the caches."""
    square = np.random.default_rng(0).normal(size=(SQUARE, SQUARE)).astype(np.float32)
    times = taken_in_turn({"": _calling(compiled(jnp.matmul), square, square)}, repeats)[""]
    return 2.0 * SQUARE**3 / float(np.median(times))


def _calling(program: Callable[..., Any], *inputs: Any) -> Call:
    return lambda _: jax.block_until_ready(program(*inputs))


def _turning(piece: Callable[..., Any], *inputs: Any) -> Call:
    """A call that does a piece many times over, each time with what the last one gave, so that none can be left out."""
    return _calling(compiled(_turned, piece, *inputs))


def _turned(piece: Callable[..., Any], *inputs: Any):
    return jax.lax.fori_loop(0, TURNS, lambda _, drift: 1e-6 * piece(drift, *inputs), jnp.zeros(()))


def _nothing(plan: Plan, sensed, goal: Goal) -> Plan:
    return plan


def _look(drift, model: ForwardModel, plan: Plan):
    return jnp.sum(model.predict(plan.configurations + drift, plan.memory))


def _look_with_slopes(drift, model: ForwardModel, plan: Plan):
    """As least squares looks: every direction of bends goes through the model side by side."""
    modules = plan.configurations.shape[0]
    directions = jnp.zeros((2 * modules, modules, 3)).at[:, :, :2].set(jnp.eye(2 * modules).reshape(-1, modules, 2))

    def along(direction):
        return jax.jvp(lambda c: model.predict(c, plan.memory), (plan.configurations + drift,), (direction,))

    states, slopes = jax.vmap(along, out_axes=(None, 0))(directions)
    return jnp.sum(states) + jnp.sum(slopes)


def _look_with_gradient(drift, model: ForwardModel, plan: Plan):
    """As Adam looks: forth through the model, and back."""
    return jnp.sum(jax.grad(lambda c: jnp.sum(model.predict(c, plan.memory) ** 2))(plan.configurations + drift))


def _solve(drift, matrix):
    return jnp.sum(jnp.linalg.solve(matrix + drift, matrix[0]))
