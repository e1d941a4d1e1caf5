"""What is drawn of a run counts as its table does."""

from types import SimpleNamespace

import numpy as np
import pytest

from s2c2a.experiments.run_folder import trace_of
from s2c2a.planning import Goal
from s2c2a.tasks import Score, Task

STEPS, MODULES = 6, 3
EARLY, LATE = np.arange(STEPS) < 2, np.arange(STEPS) >= 2


def trace(*scores: Score):
    goal = Goal.of(MODULES).with_position([0.1, 0.0, 0.2], module=0).with_position([0.1, 0.0, 0.5])
    task = Task("two ends", (goal,) * STEPS, scores)
    rollout = SimpleNamespace(task=task, times=0.1 * np.arange(STEPS), states=np.zeros((STEPS, MODULES, 6)))
    return trace_of(SimpleNamespace(controller="s2c2a", rollout=rollout))


@pytest.mark.parametrize("tip", [-1, 2])
def test_the_steps_that_count_are_those_of_the_module_that_is_drawn(tip):
    both = trace(Score("position", 0, EARLY), Score("position", tip, LATE), Score("recovery", tip, EARLY))
    np.testing.assert_array_equal(both.counted, LATE)


def test_all_steps_count_where_no_score_says_otherwise():
    assert trace(Score("position")).counted.all()
    assert trace(Score("position", 0, EARLY)).counted.all()
