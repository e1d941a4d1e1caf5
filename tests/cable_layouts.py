"""Angles of cables around a module [deg]."""

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st

from s2c2a.arm import ArmSpec, Module


@st.composite
def layouts(draw, least=0.2, widest=178.0):
    """Cable angles [deg] of three to eight cables that can bend every way."""
    shares = draw(st.lists(st.floats(least, 1), min_size=3, max_size=8))
    gaps = 360 * np.array(shares) / np.sum(shares)
    assume(gaps.max() < widest)
    return tuple(draw(st.floats(-180, 180)) + np.cumsum(gaps))


def even(cables, offset=0.0):
    return tuple(offset + 360.0 * cable / cables for cable in range(cables))


def arm_of(angles, actuation="displacement", **values) -> ArmSpec:
    """An arm of one module with cables at these angles."""
    kind = {"length": 0.2, "cable_radius": 0.027, "mass": 0.075} | values
    module = Module(cable_angles_deg=tuple(angles), bending_stiffness=0.16, **kind)
    return ArmSpec(name="arm", actuation=actuation, modules=(module,))
