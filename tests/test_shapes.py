"""Shapes and types of arguments are checked while tests run (pyproject.toml)."""

import jax.numpy as jnp
import pytest
from jaxtyping import TypeCheckError

from s2c2a.estimation import kalman
from s2c2a.kinematics import configurations_from_bends


def test_a_wrong_shape_is_refused():
    with pytest.raises(TypeCheckError, match=r"configurations_from_bends"):
        configurations_from_bends(jnp.zeros((4, 3)))


def test_shapes_that_disagree_are_refused():
    with pytest.raises(TypeCheckError, match=r"predict"):
        kalman.predict(jnp.eye(2), jnp.eye(3), jnp.zeros(3))
