"""Where a lasting position error comes from: goal -> plan -> sensed arm -> true arm.

The distance of the plan from its goal is a matter of reach, obstacles or the step limit;
that of the sensed arm from the plan one of tracking; the rest of the forward model.
"""

from collections.abc import Mapping
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry
from s2c2a.episodes import Episode
from s2c2a.kinematics import bends_from_configurations, states_from_bends
from s2c2a.planning import SIGNIFICANT, Outcome, reach_gaps
from s2c2a.spaces import POSITION

LAST_PART = 0.25  # of a run, in which an error lasts
MIN_LOAD = 0.1  # of the arm's mass; a smaller payload overloads no arm
CHAIN = {"predicted", "planned", "sensed", "outcome", "plan_error", "desired_positions"}
TROUBLES = {
    Outcome.STALLED: "stalled",
    Outcome.OUT_OF_REACH: "out of reach",
    Outcome.BLOCKED: "blocked",
}
"""Outcomes in which a plan does not get nearer to its goal."""


class _Distances(NamedTuple):
    """Typical distances along the chain [m]; of the true arm NaN where unknown."""

    error: float
    plan: float
    tracking: float
    model: float


def describe_step_plan(diagnostics: Mapping[str, np.ndarray]) -> str:
    """Describe that the plan of a control step does not get nearer to its goal.

    Args:
        diagnostics: telemetry of a step, by column of an episode: `outcome` and
            `plan_error` [m].
    """
    number = float(diagnostics.get("outcome", np.nan))
    if number not in TROUBLES:
        return ""
    distance = 100.0 * float(diagnostics.get("plan_error", np.nan))
    return f"plan {TROUBLES[Outcome(int(number))]}, {distance:.1f} cm from its goal"  # type: ignore[call-arg]


def describe_lasting_error(episode: Episode) -> str:
    """Describe the position error at the end of a run and its cause, in a sentence.

    Returns:
        Empty if the median error in the last quarter of the run is at most 1 % of the
        arm's length, or if the run has no plans or no desired positions.
    """
    if not episode.columns.keys() >= CHAIN:
        return ""
    steps = _last_steps(episode)
    if not len(steps):
        return ""
    distances = _distances(episode, steps)
    if not distances.error > SIGNIFICANT * episode.arm.length:
        return ""
    causes = (_plan_cause, _tracking_cause, _model_cause)
    cause = causes[int(np.nanargmax(distances[1:]))]
    return (
        f"position error {100 * distances.error:.1f} cm in the last quarter of the run: "
        f"{cause(episode, steps, distances)}"
    )


def _last_steps(episode: Episode) -> Float[np.ndarray, " steps"]:
    """Rows of the last quarter of the run that have a plan for a position."""
    running = episode.running
    last = running[int((1.0 - LAST_PART) * len(running)) :]
    last = last[last + 1 < len(episode)]
    gaps = episode["predicted"][..., POSITION] - episode["desired_positions"]
    has_plan = np.isfinite(gaps).all(axis=-1).any(axis=-1)
    has_plan &= np.isfinite(episode["plan_error"])
    # a controller of the user's own may have other numbers
    has_plan &= np.isin(episode["outcome"], list(Outcome))
    return last[has_plan[last]]


def _distances(episode: Episode, steps: np.ndarray) -> _Distances:
    goals = episode["desired_positions"][steps]
    predicted = episode["predicted"][steps][..., POSITION]
    plan = float(np.median(episode["plan_error"][steps]))
    tracked = _ends(episode, episode["sensed"][steps + 1])
    planned = _ends(episode, episode["planned"][steps])
    tracking = _median_distance(tracked, planned, goals)
    if "states" not in episode.sensors:
        return _Distances(max(plan, tracking), plan, tracking, np.nan)
    states = episode.sensor("states")[steps + 1][..., POSITION]
    error = _median_distance(states, goals, goals)
    model = _median_distance(states - predicted, tracked - planned, goals)
    return _Distances(error, plan, tracking, model)


def _ends(episode: Episode, configurations: np.ndarray) -> np.ndarray:
    """Module ends of an arm of arcs [m], for the effect of bends on them."""
    lengths = jnp.asarray(ArmGeometry.of(episode.arm).lengths, jnp.float32)
    bends = bends_from_configurations(jnp.asarray(configurations, jnp.float32))
    return np.asarray(states_from_bends(bends, lengths))[..., POSITION]


def _median_distance(first: np.ndarray, second: np.ndarray, goals: np.ndarray) -> float:
    """Median over the steps of the largest distance of ends that have a goal [m]."""
    distances = np.linalg.norm(first - second, axis=-1)
    has_goal = np.isfinite(goals).all(axis=-1)
    largest = np.where(has_goal, distances, 0.0).max(axis=-1)
    known = largest[np.isfinite(largest)]
    return float(np.median(known)) if len(known) else float("nan")


def _plan_cause(episode: Episode, steps: np.ndarray, distances: _Distances) -> str:
    """Reach, payload, obstacles, a stalled planner, or a goal that moves too fast."""
    missed = episode["plan_error"][steps] > SIGNIFICANT * episode.arm.length
    if not missed.any():
        return "plan, tracking and forward model each err a little"
    steps = steps[missed]
    outcomes, counts = np.unique(episode["outcome"][steps], return_counts=True)
    outcome = Outcome(int(outcomes[np.argmax(counts)]))  # type: ignore[call-arg]
    distance = f"{100 * distances.plan:.1f} cm"
    if outcome is Outcome.OUT_OF_REACH:
        return _reach_cause(episode, steps, distance)
    obstacles = episode.get("obstacles")
    if obstacles is not None and (obstacles[steps][..., 3] > 0.0).any():
        return (
            f"the plan stays {distance} from its goal beside obstacles (outcome "
            f"{outcome.name}); move the obstacles or the goal"
        )
    if outcome is Outcome.MOVING:
        return f"the plan is {distance} behind its goal; try a slower --pace"
    sentence = outcome.sentence.removesuffix(".")
    return (
        f"the plan is {distance} from its goal, and a slower pace does not help; "
        f"outcome {outcome.name}: {sentence[0].lower()}{sentence[1:]}"
    )


def _reach_cause(episode: Episode, steps: np.ndarray, distance: str) -> str:
    goal, end = _worst_end(episode, steps[-1])
    payload = (
        float(episode["payload"][steps[-1]]) if "payload" in episode.columns else 0
    )
    mass = sum(module.mass for module in episode.arm.modules)
    gap = reach_gaps(episode.arm, goal[None])[0]
    if payload > MIN_LOAD * mass and gap <= SIGNIFICANT * episode.arm.length:
        return (
            f"with {1000 * payload:.0f} g (estimated) the goal is out of reach by "
            f"{distance} of the arm's own model"
        )
    place = ", ".join(f"{coordinate:.3f}" for coordinate in end)
    return (
        f"the goal is out of reach by {distance} of the arm's own model; the nearest "
        f"point that the planner found at the end is ({place}) m"
    )


def _worst_end(episode: Episode, step: int) -> tuple[np.ndarray, np.ndarray]:
    """Goal and predicted position of the end that is farthest from its goal [m]."""
    goals = episode["desired_positions"][step]
    ends = episode["predicted"][step][..., POSITION]
    module = int(np.nanargmax(np.linalg.norm(ends - goals, axis=-1)))
    return goals[module], ends[module]


def _tracking_cause(episode: Episode, steps: np.ndarray, distances: _Distances) -> str:
    planned = bends_from_configurations(jnp.asarray(episode["planned"][steps]))
    sensed = bends_from_configurations(jnp.asarray(episode["sensed"][steps + 1]))
    errors = np.linalg.norm(np.asarray(sensed - planned), axis=-1).max(axis=-1)
    return (
        f"the sensed bends stay {np.rad2deg(np.nanmedian(errors)):.1f} deg from the "
        f"planned ones ({100 * distances.tracking:.1f} cm); see the limits of the "
        "motors and the controller"
    )


def _model_cause(episode: Episode, steps: np.ndarray, distances: _Distances) -> str:
    return (
        "the arm follows its plan, but its ends are "
        f"{100 * distances.model:.1f} cm from where the forward model predicts them; "
        "try a slower --pace, data of these shapes, or sensors that measure disturbances"
    )
