"""The simulated arm at rest against an independent rod."""

import numpy as np
import pytest

from rod_cases import rod_cases
from simulator_accuracy import settled_tip

CASES = {case.name: case for case in rod_cases()}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["C", "D", "E"])
def test_the_accurate_arm_comes_to_rest_within_1_5_mm_of_the_rod(name):
    case = CASES[name]
    assert np.linalg.norm(settled_tip(case.arm, case, "accurate") - case.tip) <= 1.5e-3


@pytest.mark.parametrize("name", sorted(CASES))
def test_the_fast_arm_comes_to_rest_within_3_mm_of_the_rod(name):
    case = CASES[name]
    assert np.linalg.norm(settled_tip(case.arm, case, "fast") - case.tip) <= 3e-3
