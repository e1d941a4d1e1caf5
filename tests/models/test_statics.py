"""Static equilibrium with cables that only pull: by hand, and by minimization."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import minimize

from s2c2a.arm.geometry import cable_matrix
from s2c2a.models.statics import bend_at_rest

from marks import slow_after

rest = jax.jit(bend_at_rest, static_argnames="engaged")
THREE = cable_matrix(np.deg2rad([[0.0, 120.0, 240.0]]))
FAR = 9.0
"""A displacement that leaves its cable slack."""


def at_rest(
    displacements,
    moments,
    matrices=THREE,
    stiffness=(4.0,),
    tautness=(0.0,),
    engaged=False,
):
    arrays = (
        np.asarray(values, np.float32)
        for values in (displacements, moments, matrices, stiffness, tautness)
    )
    return np.asarray(rest(*arrays, engaged=engaged))


def random_cases(seed, count, cables):
    """Single modules whose cables nearly agree on one bend, with a moment."""
    random = np.random.default_rng(seed)
    angles = random.uniform(0, 6, (count, 1)) + 2 * np.pi * np.arange(cables) / cables
    matrices = cable_matrix(angles + random.normal(0, 0.1, (count, cables)))
    desired = np.einsum("mnk,mk->mn", matrices, random.normal(0, 0.5, (count, 2)))
    return (
        desired + random.normal(0, 0.05, (count, cables)),
        random.normal(0, 0.4, (count, 2)),
        matrices,
        np.exp(random.uniform(-0.7, 3.0, count)),
        random.normal(0, 0.03, count),
    )


def min_energy(displacements, moment, matrix, stiffness, tautness):
    """The bend of least 0.5 |b|^2 - m b + 0.5 kappa sum_i max(0, B_i b - w_i)^2."""

    def energy(bend):
        stretched = np.maximum(matrix @ bend - displacements + tautness, 0.0)
        slope = bend - moment + stiffness * matrix.T @ stretched
        return (
            0.5 * bend @ bend - moment @ bend + 0.5 * stiffness * stretched @ stretched,
            slope,
        )

    return minimize(energy, np.zeros(2), jac=True, options={"gtol": 1e-9}).x


ONE_TAUT = [-0.5, FAR, FAR]
AT_REST = [0.0, 0.0, 0.0]
BY_HAND = {
    # B_1 = (-1, 0): at displacement -0.5, beta_x = kappa 0.5 / (1 + kappa)
    "one taut cable is a spring": (ONE_TAUT, [0.0, 0.0], 0.0, [0.4, 0.0]),
    "across it the moment acts alone": (ONE_TAUT, [0.1, 0.3], 0.0, [0.42, 0.3]),
    "pretension adds": (ONE_TAUT, [0.0, 0.0], 0.25, [0.6, 0.0]),
    "all taut hold it straight": (AT_REST, [0.0, 0.0], 0.3, [0.0, 0.0]),
    # three even cables have sum B B^T = 1.5: beta = m / (1 + 1.5 kappa)
    "all taut share the moment": (AT_REST, [0.07, -0.14], 1.0, [0.01, -0.02]),
    "slack cables do nothing": ([FAR, FAR, FAR], [0.2, -0.3], 0.0, [0.2, -0.3]),
}


@pytest.mark.parametrize(
    ("displacements", "moment", "tautness", "bend"), BY_HAND.values(), ids=BY_HAND
)
def test_bends_at_rest_are_those_worked_by_hand(displacements, moment, tautness, bend):
    found = at_rest([displacements], [moment], tautness=[tautness])
    np.testing.assert_allclose(found, [bend], atol=1e-6)


@pytest.mark.parametrize("cables", slow_after(1, range(3, 9)))
def test_at_rest_is_where_the_energy_is_least(cables):
    cases = random_cases(cables, 200, cables)
    expected = [min_energy(*case) for case in zip(*cases, strict=True)]
    np.testing.assert_allclose(at_rest(*cases), expected, atol=2e-4)


def slopes(displacements, engaged):
    """d beta / d displacements of one module, shape (2, cables)."""
    constants = [
        jnp.asarray(values, dtype=jnp.float32)
        for values in ([[0.0, 0.0]], THREE, [4.0], [0.0])
    ]
    values = jnp.asarray(displacements, dtype=jnp.float32)
    return np.asarray(
        jax.jacrev(lambda d: bend_at_rest(d[None], *constants, engaged=engaged)[0])(
            values
        )
    )


@pytest.mark.slow
def test_a_slack_cable_has_no_gradient_unless_engaged():
    true = slopes([-0.5, FAR, FAR], engaged=False)
    engaged = slopes([-0.5, FAR, FAR], engaged=True)
    np.testing.assert_allclose(true, [[-0.8, 0, 0], [0, 0, 0]], atol=1e-6)
    all_taut = 4.0 * THREE[0].T / (1 + 1.5 * 4.0)
    np.testing.assert_allclose(engaged, all_taut, atol=1e-6)


def test_slopes_agree_with_finite_differences_away_from_kinks():
    """For one taut and two slack cables, far from any change of contact."""
    inputs = [[[-0.5, 0.9, 0.9]], [[0.1, 0.05]], [3.0], [0.05]]

    @jax.jit
    def total(displacements, moments, stiffness, tautness):
        bends = bend_at_rest(
            displacements, moments, jnp.asarray(THREE), stiffness, tautness
        )
        return jnp.sum(bends * jnp.array([1.0, 0.7]))

    with jax.enable_x64(True):
        arrays = [jnp.asarray(value) for value in inputs]
        gradients = jax.grad(total, argnums=(0, 1, 2, 3))(*arrays)
        for place, gradient in enumerate(gradients):
            for entry in np.ndindex(gradient.shape):
                values = []
                for shift in (1e-5, -1e-5):
                    shifted = list(arrays)
                    shifted[place] = arrays[place].at[entry].add(shift)
                    values.append(float(total(*shifted)))
                slope = (values[0] - values[1]) / 2e-5
                assert float(gradient[entry]) == pytest.approx(slope, abs=1e-6)
