"""Piecewise constant curvature kinematics: cables, bends, configurations, states.

Pure JAX, batched and differentiable.
"""

from s2c2a.arm.geometry import center_line
from s2c2a.kinematics.bends import (
    bends_from_cables,
    bends_from_configurations,
    commanded_configurations,
    commanded_part,
    configurations_from_bends,
    limit_lengths,
    norm,
)
from s2c2a.kinematics.chain import (
    bends_from_states,
    configurations_from_states,
    states_from_bends,
    states_from_configurations,
)
from s2c2a.kinematics.pcc import PCC
