"""Angles of cables around a module [deg]."""

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st


@st.composite
def layouts(draw, least=0.2, widest=178.0):
    """Cable angles [deg] of three to eight cables that can bend every way."""
    shares = draw(st.lists(st.floats(least, 1), min_size=3, max_size=8))
    gaps = 360 * np.array(shares) / np.sum(shares)
    assume(gaps.max() < widest)
    return tuple(draw(st.floats(-180, 180)) + np.cumsum(gaps))


def even(cables, offset=0.0):
    return tuple(offset + 360.0 * cable / cables for cable in range(cables))
