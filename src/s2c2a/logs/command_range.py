"""Range and rates of the commands in a log, as lines of an arm file."""

from collections.abc import Sequence
from decimal import ROUND_CEILING, Decimal

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.arm.fields import FORCE, LENGTH, PRESSURE
from s2c2a.episodes import Episode
from s2c2a.runtime.limits import CommandLimits

MIN_STEP = 1e-3  # rad; smaller changes are not steps
# range of the step limit: a jump between random poses does not justify one step
STEP_RANGE_DEG = (0.1, 20.0)
# of the moving steps; a few in a hundred are jumps, as between the parts of a log
TYPICAL = 0.95
ROUNDING = 1e-6  # of the range [1] and of bends [rad]
MOST = 0.99  # of the rows, for the comment that shows how far single rows go beyond

RANGE_KEYS = {
    "displacement": "cable.travel",
    "tension": "tension_range",
    "pressure": "pressure_limit",
}

Commands = Sequence[Float[np.ndarray, "rows modules cables"]]


def range_lines(
    commands: Float[np.ndarray, "rows cables"], actuation: str, full_bend: float
) -> list[str]:
    """Lines of a module's table: the range that holds all commands of the log.

    The range is the same in both directions and for all cables of the module, so it
    also holds what the cables have in common and the offset of each from its rest.

    Args:
        commands: actions of the module's cables [m, N or Pa].
        actuation: of the arm.
        full_bend: displacement of a cable at the bend limit [m].
    """
    if actuation == "displacement" and not commands.shape[1]:
        return []
    sizes = np.abs(commands).max(axis=1, initial=0.0)
    largest = sizes.max()
    if actuation == "pressure":
        size = np.clip(largest, PRESSURE.low, PRESSURE.high)
        remark = f"the log's is {largest:.0f}; in 99 of 100 rows"
        remark += f" {np.quantile(sizes, MOST):.0f}"
        return [f"pressure_limit = {round_up(float(size), '1')}  # {remark}"]
    remark = f"the log's is {largest:.5f}; in 99 of 100 rows {{:.5f}}"
    remark = remark.format(np.quantile(sizes, MOST))
    if actuation == "tension":
        size = round_up(float(np.clip(largest, FORCE.low, FORCE.high)), "0.01")
        return [f"tension_range = {size}  # {remark}"]
    common = np.abs(commands.mean(axis=1)).max()
    needed = float(np.clip(max(largest, full_bend), LENGTH.low, LENGTH.high))
    remark += f", common to all cables {common:.5f}"
    return [
        "",
        "[modules.cable]",
        f"travel = {round_up(needed, '0.00001')}  # {remark}",
    ]


def rate_lines(arm: ArmSpec, commands: Commands, moving: bool) -> list[str]:
    """Lines of the limits of rate and acceleration, from the motion in the log.

    They count bends that the commands hold, as the limits of commands do.

    Args:
        arm: with the range of the log.
        commands: actions [m, N or Pa] of each segment.
        moving: whether rows follow each other in time; a log of poses at rest shows no
            acceleration.
    """
    step = _typical_change_deg(arm, commands, 1)
    step = float(np.clip(step, *STEP_RANGE_DEG))
    share = f"{100 * TYPICAL:.0f} of 100"
    lines = [f"step_limit_deg = {step:.1f}  # {share} steps of the log are shorter"]
    acceleration = _typical_change_deg(arm, commands, 2) if moving else 0.0
    if acceleration > 0.0:
        # no more than it takes to reverse
        acceleration = min(acceleration, 2.0 * step)
        lines.append(
            f"acceleration_limit_deg = {acceleration:.2f}"
            f"  # {share} changes of a step are smaller"
        )
    return lines


def _typical_change_deg(arm: ArmSpec, commands: Commands, order: int) -> float:
    """Size of the differences of some order that most moving rows stay below [deg]."""
    limits = CommandLimits.of(arm)
    bends = ArmGeometry.of(arm).action_bends[:, None]
    changes = [
        limits.change_sizes(np.diff(segment, order, axis=0))
        for segment in commands
        if len(segment) > order
    ]
    sizes = [(change * bends).max(axis=(1, 2)) for change in changes]
    largest = np.concatenate([*sizes, np.zeros(0)])
    moving = largest[largest > MIN_STEP]
    return float(np.rad2deg(np.quantile(moving, TYPICAL))) if len(moving) else 0.0


def round_up(value: float, unit: str) -> Decimal:
    """Round a number up, so that a range still holds its largest value."""
    return Decimal(f"{value:.9f}").quantize(Decimal(unit), ROUND_CEILING)


def describe_range(episodes: Sequence[Episode]) -> list[str]:
    """Describe which share of the rows is beyond the range of commands or of plans."""
    arm = episodes[0].arm
    geometry = ArmGeometry.of(arm)
    actions = np.concatenate([episode["actions"] for episode in episodes])
    tolerance = ROUNDING * (geometry.action_high - geometry.action_low)
    is_outside = actions < geometry.action_low - tolerance
    is_outside |= actions > geometry.action_high + tolerance
    bends = np.linalg.norm(geometry.commanded_bends(actions), axis=-1)
    is_unplanned = bends > geometry.planned_bends + ROUNDING
    advice = f"a larger {RANGE_KEYS[arm.actuation]} holds them"
    if arm.actuation == "pressure" and actions.min() < 0.0:
        advice = (
            f"the lowest is {actions.min():.4g} Pa, and chambers of this package only "
            "push, from 0 Pa: vacuum is not supported (pressures at rest are the "
            "`offset` of a drive)"
        )
    shares = {
        f"beyond the range of '{arm.name}'; {advice}": is_outside.any(
            axis=(1, 2)
        ).mean(),
        "that hold larger bends than plans use; a larger bend_limit_deg lets plans "
        "use them": is_unplanned.any(axis=1).mean(),
    }
    return [
        f"range: {100 * share:.3g} % of the steps have commands {text}"
        for text, share in shares.items()
        if share
    ]
