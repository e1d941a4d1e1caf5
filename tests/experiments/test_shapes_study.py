"""The study of shapes: what it asks for, and the best fit of a curve."""

import numpy as np

from s2c2a.arm import ArmGeometry
from s2c2a.arm.geometry import center_line
from s2c2a_experiments import shapes, true_reach
from s2c2a_experiments.shapes import ShapeStudy, best_fit, shape_rows
from s2c2a_experiments.true_reach import TrueReach


def test_every_kind_of_curves_is_taken_by_both_strategies(twin, monkeypatch, asked):
    monkeypatch.setattr(shapes, "best_fit", lambda reach, curve: 0.0)
    jobs = asked(shape_rows, ShapeStudy((twin,), curves=1))
    assert [(job.task.name, job.strategy) for job in jobs] == [
        ("own curve 0", "s2c2a"),
        ("own curve 0", "pcc"),
        ("foreign curve 0", "s2c2a"),
        ("foreign curve 0", "pcc"),
    ]


def test_a_curve_of_the_arm_itself_is_fitted(twin, monkeypatch):
    monkeypatch.setattr(true_reach, "SAMPLES", 32)
    reach = TrueReach(twin)
    actions = np.array([[[0.3, 0.1], [0.2, 0.2], [-0.2, 0.1]]])
    line = center_line(reach.states(actions), ArmGeometry.of(twin).lengths)[0]
    assert best_fit(reach, np.concatenate([np.zeros((1, 3)), line])) < 0.1
