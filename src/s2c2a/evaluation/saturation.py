"""Saturation: commands at the limits of their range, not those of their rate."""

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.arm.geometry import cables_present
from s2c2a.arm.spec import REQUIRED
from s2c2a.episodes import Episode
from s2c2a.evaluation.report import RARE
from s2c2a.runtime.limits import EQUAL, command_range
from s2c2a.spaces import Actions


def describe_saturation(arm: ArmSpec, actions: Actions) -> str:
    """Describe how often sent commands were at a limit of their range, and which cable.

    Args:
        arm: with the range.
        actions: that were sent [m or N].

    Returns:
        A sentence; empty if few commands were at a limit (`RARE`).
    """
    steps = actions.reshape(-1, arm.module_count, arm.cable_count)
    low, high = command_range(arm)
    tolerance = EQUAL * (high - low)
    # the slack cables of a tension arm are at zero as they should
    is_low = (steps <= low + tolerance) & (low != 0.0)
    is_high = steps >= high - tolerance
    is_limited = (is_low | is_high) & cables_present(arm)
    limited = is_limited.any(axis=(1, 2))
    if 100 * limited.sum() <= RARE * len(limited):
        return ""
    key = "cable.travel"  # of the arm file, that limits commands
    if arm.actuation != "displacement":
        key = REQUIRED[arm.actuation][0]
    elif arm.servos is not None and arm.servos.limits.displacement is not None:
        key = "cable.travel or servos.limits.displacement"
    counts = is_limited.sum(axis=0)
    module, cable = np.unravel_index(counts.argmax(), counts.shape)
    return (
        f"commands were at a limit of their range in {100 * limited.mean():.3g} % of the steps, "
        f"most often cable {cable + 1} of module {module + 1}: motion nearer to rest "
        f"needs less, and a larger {key} in the arm file allows more, if the arm bears "
        "it, after new training"
    )


def describe_run_saturation(episode: Episode) -> str:
    """Describe the same of the steps of a run."""
    return describe_saturation(episode.arm, episode.ran("actions"))
