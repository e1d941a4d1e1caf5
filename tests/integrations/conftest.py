"""What tests of topics share."""

import numpy as np
import pytest

from s2c2a.live.snapshot import Snapshot, straight
from s2c2a.runtime import StepRecord
from s2c2a.spaces import Reading, Stage


@pytest.fixture
def snapshot(twin):
    """A straight arm that runs."""
    reading = Reading(0.0, {"cables": np.arange(9.0).reshape(3, 3)})
    step = StepRecord(4, 1.0, Stage.RUN, reading, None, np.zeros((3, 3)))
    states = straight(twin)
    return Snapshot(step, Stage.RUN, states, states, 0.0, 0.01, np.inf, 0, 0, "pcc")
