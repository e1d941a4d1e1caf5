"""Reports: result rows as JSON, and text on plans."""

import csv
import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool
from pydantic import ConfigDict

from s2c2a.arm import ArmGeometry
from s2c2a.episodes import Episode
from s2c2a.errors import counted, listed
from s2c2a.evaluation.metrics import body_clearances, clearances
from s2c2a.files.text import atomic_write, write_atomically
from s2c2a.kinematics import bends_from_configurations
from s2c2a.measurements.frame_jumps import describe_frame_jump, find_frame_jumps
from s2c2a.planning import SIGNIFICANT, Outcome
from s2c2a.spaces import POSITION, Stage, States

PLAN_OUTCOMES = {
    Outcome.STALLED: "the planner stood still short of its goal",
    Outcome.OUT_OF_REACH: "the planner came no nearer to its goal",
    Outcome.BLOCKED: "the planner found no free way to its goal",
    Outcome.OVERLOADED: "the planner found the arm overloaded",
    Outcome.PASSING: "an obstacle on or near the path of the target kept the tip off",
}
"""What the planner did in a step; plans that reach their goal or move are not reported."""
RARE = 2.0  # % of the steps: so few are not reported; the last one always lacks a state


@dataclass(frozen=True)
class Row:
    """One line of `results.json`.

    `mean` and `std_steps` are over the steps of a run, as in the paper, averaged over
    seeds; `std_seeds` is the standard deviation of the means between seeds.
    """

    experiment: str
    task: str
    arm: str
    fidelity: str
    strategy: str
    recipe: str
    metric: str
    unit: str
    mean: float
    std_steps: float | None = None
    std_seeds: float | None = None
    seeds: tuple[int, ...] = ()
    paper_mean: float | None = None
    paper_std: float | None = None
    first_mode_hz: float | None = None
    damping_ratio: float | None = None

    __pydantic_config__ = ConfigDict(extra="forbid")


def over_seeds(
    values: Sequence[float], spreads: Sequence[float] = ()
) -> dict[str, Any]:
    """Return `mean`, `std_steps`, and `std_seeds` of a `Row`.

    Args:
        values: one value a seed.
        spreads: standard deviations over the steps of each run, if known.
    """
    std_seeds = None
    if len(values) > 1 and np.isfinite(values).all():
        std_seeds = float(np.std(values, ddof=1))
    std_steps = float(np.mean(spreads)) if len(spreads) else None
    mean = float(np.mean(values))
    return {"mean": mean, "std_steps": std_steps, "std_seeds": std_seeds}


def pair(mean: float, spread: float | None) -> str:
    """Format a mean and its spread, if any, for a table."""
    return f"{mean:.2f}" if spread is None else f"{mean:.2f} ± {spread:.2f}"


def describe_plans(episode: Episode) -> str:
    """Describe in how many steps of a run planning was difficult; empty if in none.

    Counted are steps in which the planner did not solve its problem (`outcome`), or
    the step limit held the plan back from a goal within reach.
    """
    if "outcome" not in episode.columns:
        return ""
    outcomes = episode.ran("outcome")
    held_back = _are_whole_steps(episode) & (outcomes == Outcome.MOVING)
    limit = f"the step limit of {episode.arm.step_limit_deg:g} deg held the plan back"
    steps = {text: outcomes == outcome for outcome, text in PLAN_OUTCOMES.items()}
    steps |= {limit: held_back}
    sentences = [
        f"{text} in {are.sum()} of {len(are)} steps"
        for text, are in steps.items()
        if are.any()
    ]
    if held_back.any():
        changes = np.diff(episode.ran("desired_positions"), axis=0, prepend=np.nan)
        if np.median((abs(changes[held_back]) > 0).any(axis=(1, 2))):
            sentences[-1] += " (a slower --pace helps)"
    return ", ".join(sentences)


def describe_touches(episode: Episode) -> str:
    """Describe how far target and arm were within obstacles; empty if neither was."""
    if "obstacles" not in episode.columns:
        return ""
    rows = episode.ran("obstacles")
    gaps = {"the target": clearances(episode.ran("desired_positions")[:, -1], rows)}
    if "states" in episode.sensors:
        after = np.minimum(episode.running + 1, len(episode) - 1)
        tips = episode.sensor("states")[after, -1, POSITION]
        of_tip = clearances(tips, rows, episode.arm.modules[-1].radius)
        line = "center_line" if "center_line" in episode.sensors else "states"
        points = episode.sensor(line)[..., POSITION]
        of_body = body_clearances(points[after], rows, episode.arm)
        gaps["the tip"] = of_tip
        gaps["the body (see --guard arm)"] = np.where(of_tip > 0, of_body, np.inf)
        last = np.arange(max(after, default=0) + 1, len(episode))
        if len(last):  # no strategy leads the arm to rest
            beside = rows[np.full_like(last, -1)]  # the obstacles of the last goal
            home = body_clearances(points[last], beside, episode.arm)
            before = np.full_like(of_tip, np.inf)
            gaps["the arm on its way to rest"] = np.append(before, home)
    sentences = []
    for name, clear in gaps.items():
        within = np.flatnonzero(clear < 0.0)
        if len(within):
            first = (within[0] + 1) / episode.arm.control_rate
            sentences.append(
                f"{name} was up to {-clear[within].min():.1f} cm within an obstacle, "
                f"first {first:g} s after the start"
            )
    return ", ".join(sentences)


def describe_faults(episode: Episode) -> str:
    """Describe faults of the readings during the run; empty if there were none."""
    faults = episode.options.get("faults", ())
    if not faults:
        return ""
    held = int((episode.columns["stage"] == Stage.HOLD).sum())
    late = episode.options.get("late_steps", 0)
    return (
        f"the arm was held in {counted(held, 'step')} because of faults "
        f"({listed(faults, '; ')}); {counted(late, 'step')} began late"
    )


def describe_tracking(episode: Episode) -> str:
    """Describe which states are not known in the run; empty if all are."""
    if "states" not in episode.sensors:
        return (
            "no scores, since nothing measured the module ends; add --tracking SOURCE "
            "(docs/guides/tracking.md)"
        )
    lost = describe_lost_states(episode.sensor("states")[episode.running])
    return "; ".join(filter(None, (lost, describe_jumps_of_frame([episode]))))


def describe_jumps_of_frame(episodes: Sequence[Episode]) -> str:
    """Describe the first jump of all tracked ends at once; empty if there is none."""
    for number, episode in enumerate(episodes, 1):
        if "states" not in episode.sensors:
            continue
        times = episode["time"]
        jumps = find_frame_jumps(episode.sensor("states"), times, episode.arm.length)
        for row, shift in jumps.items():
            place = f"episode {number}, " if len(episodes) > 1 else ""
            place += f"step {row + 1} ({times[row]:.1f} s)"
            return f"{place}: {describe_frame_jump(shift)}"
    return ""


def describe_lost_states(states: States) -> str:
    """Describe which module ends have no state, and how often; empty if all have."""
    is_lost = np.isnan(states).any(axis=-1).reshape(-1, states.shape[-2])
    if not len(is_lost):
        return ""
    shares = 100.0 * is_lost.mean(axis=0)
    texts = [
        f"module {module} in {share:.3g} %"
        for module, share in enumerate(shares, 1)
        if share > RARE
    ]
    return f"ends not tracked: {', '.join(texts)} of the steps" if texts else ""


def _are_whole_steps(episode: Episode) -> Bool[np.ndarray, " steps"]:
    """Steps whose plan moved by the whole step limit."""
    if "planned" not in episode.columns or not len(episode.running):
        return np.zeros(len(episode.running), dtype=bool)
    bends = np.asarray(bends_from_configurations(jnp.asarray(episode.ran("planned"))))
    changes = np.diff(bends, axis=0, prepend=bends[:1])
    # plans have single precision
    whole = (1.0 - SIGNIFICANT) * ArmGeometry.of(episode.arm).step_limit
    return np.linalg.norm(changes, axis=-1).max(axis=-1) > whole


def save_rows(rows: Iterable[Row], path: str | Path) -> None:
    """Write `results.json`; JSON has no infinity or NaN, so these become strings."""
    written = [
        {key: _json_value(value) for key, value in asdict(row).items()} for row in rows
    ]
    write_atomically(json.dumps(written, indent=1, allow_nan=False) + "\n", path)


def _json_value(value: Any) -> Any:
    return str(value) if isinstance(value, float) and not np.isfinite(value) else value


def save_csv(header: Sequence[str], rows: Iterable[Sequence], path: str | Path) -> None:
    """Write a table of comma-separated values."""
    with (
        atomic_write(path) as part,
        open(part, "w", newline="", encoding="utf-8") as file,
    ):
        csv.writer(file).writerows([header, *rows])
