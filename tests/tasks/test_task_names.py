"""Names of tasks: with a pace."""

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.errors import TargetError
from s2c2a.tasks import load_task, paced_task

TWIN = load_arm("twin_arm")


def test_a_pace_in_the_name_of_a_task_slows_it():
    fast = load_task("square", TWIN)
    slow = load_task("square@0.5", TWIN)
    assert slow.name == "square@0.5"
    assert len(slow.goals) == pytest.approx(2 * len(fast.goals), abs=2)
    end = fast.desired_positions()[-1]
    np.testing.assert_allclose(slow.desired_positions()[-1], end, atol=1e-6)


@pytest.mark.parametrize("pace", [0.0, 101.0, float("nan")])
def test_an_impossible_pace_is_refused(pace):
    with pytest.raises(TargetError, match=r"give 0\.01 to 10"):
        paced_task("square", TWIN, pace)


def test_a_name_with_another_ending_is_no_pace():
    with pytest.raises(TargetError):
        load_task("square@slow", TWIN)


def test_a_task_in_place_of_its_name_is_refused_with_a_reason():
    task = load_task("circle", TWIN)
    for load in (load_task, lambda given, arm: paced_task(given, arm, 0.5)):
        with pytest.raises(TargetError, match="goals are made already; give its name"):
            load(task, TWIN)
