"""The one length scale that planners share."""

from s2c2a.arm import ArmSpec

WORKSPACE_SHARE = 0.46 / 0.6
"""Half the width of the paper's workspace over the length of its arm (Chen et al. 2025, sec. II-D)."""


def planning_scale(arm: ArmSpec) -> float:
    """What a length of one stands for in the losses [m]; every controller weighs metres alike, with data or without."""
    return WORKSPACE_SHARE * arm.length
