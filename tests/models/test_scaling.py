"""Scaling of features to [-1, 1]."""

import numpy as np

from s2c2a.models.layers import Scaling

VALUES = np.random.default_rng(0).uniform(-3, 7, (4, 5, 3)) * [1.0, 10.0, 0.01]


def test_scaling_maps_its_values_to_the_full_range():
    scaled = np.asarray(Scaling.of(VALUES).forward(VALUES.astype(np.float32))).reshape(
        -1, 3
    )
    np.testing.assert_allclose(scaled.min(axis=0), -1, atol=1e-5)
    np.testing.assert_allclose(scaled.max(axis=0), 1, atol=1e-5)


def test_scaling_by_hand():
    scaling = Scaling.of(np.array([[2.0, -1.0], [6.0, 3.0]]))
    np.testing.assert_allclose(scaling.forward(np.array([5.0, 1.0])), [0.5, 0.0])
    np.testing.assert_allclose(scaling.back(np.array([0.5, 0.0])), [5.0, 1.0])


def test_a_feature_that_never_changes_keeps_its_unit():
    scaling = Scaling.of(np.array([[4.0, 0.0], [4.0, 1.0]]))
    np.testing.assert_allclose(scaling.forward(np.array([4.5, 1.0])), [0.5, 1.0])
