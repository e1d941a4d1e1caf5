"""Where a lasting position error comes from: goal -> plan -> sensed arm -> true arm.

The distance of the plan from its goal is a matter of reach, obstacles or the step limit;
that of the sensed arm from the plan one of tracking; the rest of the forward model.
"""

from collections.abc import Mapping

import jax.numpy as jnp
import numpy as np

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.episodes import Episode
from s2c2a.evaluation.report import PLAN_OUTCOMES
from s2c2a.kinematics import bends_from_configurations, states_from_bends
from s2c2a.planning import SIGNIFICANT, Outcome
from s2c2a.spaces import POSITION, Configurations

LAST_PART = 0.25  # of a run, in which an error lasts
CHAIN = {"predicted", "planned", "sensed", "plan_error", "desired_positions"}


def describe_step_plan(diagnostics: Mapping[str, np.ndarray]) -> str:
    """Describe that the plan of a control step does not get nearer to its goal.

    Args:
        diagnostics: telemetry of a step, by column of an episode: `outcome` and
            `plan_error` [m].
    """
    number = float(diagnostics.get("outcome", np.nan))
    if number not in PLAN_OUTCOMES:
        return ""
    distance = 100.0 * float(diagnostics.get("plan_error", np.nan))
    outcome = Outcome(int(number)).name.lower().replace("_", " ")
    return f"plan {outcome}, {distance:.1f} cm from its goal"


def describe_lasting_error(episode: Episode) -> str:
    """Describe the position error at the end of a run and its parts, in a sentence.

    Returns:
        Empty if the median error in the last quarter of the run is at most 1 % of the
        arm's length, or if the run has no plans or no desired positions.
    """
    if not episode.columns.keys() >= CHAIN:
        return ""
    # rows of the last quarter of the run that have a plan for a position
    running = episode.running
    last = running[int((1.0 - LAST_PART) * len(running)) :]
    last = last[last + 1 < len(episode)]
    gaps = episode["predicted"][..., POSITION] - episode["desired_positions"]
    has_plan = np.isfinite(gaps).all(axis=-1).any(axis=-1)
    has_plan &= np.isfinite(episode["plan_error"])
    steps = last[has_plan[last]]
    if not len(steps):
        return ""
    # typical distances along the chain [m]; of the true arm NaN if unknown
    goals = episode["desired_positions"][steps]
    predicted = episode["predicted"][steps][..., POSITION]
    plan = float(np.median(episode["plan_error"][steps]))
    tracked = module_ends(episode.arm, episode["sensed"][steps + 1])
    planned = module_ends(episode.arm, episode["planned"][steps])
    tracking = _median_distance(tracked, planned, goals)
    error = max(plan, tracking)
    model = np.nan
    if "states" in episode.sensors:
        states = episode.sensor("states")[steps + 1][..., POSITION]
        error = _median_distance(states, goals, goals)
        model = _median_distance(states - predicted, tracked - planned, goals)
    if not error > SIGNIFICANT * episode.arm.length:
        return ""
    text = (
        f"median position error {100 * error:.1f} cm in the last quarter of the run: the plan "
        f"is {100 * plan:.1f} cm from its goal, the sensed arm {100 * tracking:.1f} cm "
        "from the plan"
    )
    if np.isnan(model):
        return text
    return (
        f"{text}, the true arm {100 * model:.1f} cm from where the forward model "
        "predicts it"
    )


def module_ends(arm: ArmSpec, configurations: Configurations) -> np.ndarray:
    """Module ends of an arm of arcs [m], for the effect of bends on them.

    Shape (rows, modules, 3), base frame.
    """
    lengths = jnp.asarray(ArmGeometry.of(arm).lengths, jnp.float32)
    bends = bends_from_configurations(jnp.asarray(configurations, jnp.float32))
    return np.array(states_from_bends(bends, lengths)[..., POSITION])


def _median_distance(first: np.ndarray, second: np.ndarray, goals: np.ndarray) -> float:
    """Median over the steps of the largest distance of ends that have a goal [m]."""
    distances = np.linalg.norm(first - second, axis=-1)
    has_goal = np.isfinite(goals).all(axis=-1)
    largest = np.where(has_goal, distances, 0.0).max(axis=-1)
    known = largest[np.isfinite(largest)]
    return float(np.median(known)) if len(known) else float("nan")
