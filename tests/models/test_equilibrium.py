"""Couplings between modules: shortening, cable paths and moments."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.arm.geometry import cable_matrix
from s2c2a.models.statics import (
    AXIAL_COMPLIANCE_UNIT,
    SWEEPS,
    Equilibrium,
    StaticState,
    bend_at_rest,
)

MATRICES = jnp.asarray(
    cable_matrix(np.deg2rad(np.tile([0.0, 120.0, 240.0], (2, 1)))), jnp.float32
)
STIFFNESS = 4.0
NO_GIVE = -30.0
CARRIED = jnp.array([[-0.4, 0.3, 0.3], [-0.2, 0.4, 0.4]], jnp.float32)
NONE = jnp.zeros((2, 2))


def equilibrium(give=NO_GIVE, coupling=(0.0, 0.0)) -> Equilibrium:
    log_stiffness = jnp.full(2, np.log(STIFFNESS))
    zeros = jnp.zeros(2)
    return Equilibrium(
        log_stiffness,
        zeros,
        jnp.full(2, give / AXIAL_COMPLIANCE_UNIT),
        jnp.array(coupling),
        jnp.zeros((2, 1)),
    )


def test_a_training_starts_from_the_arm_file_where_cables_yield():
    twin = load_arm("twin_arm")
    stiff = twin.modules[2].cable.model_copy(update={"stiffness": 1e5})
    last = twin.modules[2].model_copy(update={"cable": stiff})
    arm = twin.model_copy(update={"modules": (*twin.modules[:2], last)})
    kappa = np.exp(Equilibrium.untrained(arm, 1).log_stiffness)
    np.testing.assert_allclose(kappa, [4.0, 3.5, 4.0], rtol=1e-3)


def rest(model: Equilibrium, sweeps=60, carried=CARRIED, engaged=False) -> StaticState:
    def sweep(number, state):
        return model.sweep(
            carried, NONE, MATRICES, jnp.ones((2, 1)), state, engaged, number == 0
        )

    state = StaticState.straight(carried)
    for number in range(2):  # reverse derivatives need a known number
        state = sweep(number, state)
    return jax.lax.fori_loop(2, sweeps, sweep, state) if sweeps > 2 else state


def test_uncoupled_modules_rest_as_single_ones():
    alone = bend_at_rest(CARRIED, NONE, MATRICES, jnp.full(2, STIFFNESS), jnp.zeros(2))
    np.testing.assert_allclose(rest(equilibrium()).bends, alone, atol=1e-6)


def test_all_cables_through_a_module_shorten_it_and_slacken_outer_ones():
    give = 0.05
    result = rest(equilibrium(give=np.log(0.05)))
    displacements = CARRIED + result.slack
    stretched = jnp.einsum("mnk,mk->mn", MATRICES, result.bends) - displacements
    pulls = STIFFNESS * np.maximum(stretched, 0.0).sum(axis=-1)
    np.testing.assert_allclose(
        result.shortening, give * np.array([pulls.sum(), pulls[1]]), rtol=1e-4
    )
    np.testing.assert_allclose(
        result.slack[:, 0], np.cumsum(result.shortening), rtol=1e-4
    )
    assert np.all(
        np.linalg.norm(result.bends, axis=-1)
        < np.linalg.norm(rest(equilibrium()).bends, axis=-1)
    )


def test_an_inner_bend_changes_outer_cable_paths_and_their_pull_bends_it():
    coupling = 0.25
    result = rest(equilibrium(coupling=(0.25, 0.0)))
    path_change = coupling * jnp.einsum("nk,k->n", MATRICES[1], result.bends[0])
    stretched = np.maximum(
        MATRICES[1] @ result.bends[1] - (CARRIED[1] - path_change), 0.0
    )
    moment = -coupling * STIFFNESS * MATRICES[1].T @ stretched
    np.testing.assert_allclose(result.pulled[0], -moment, atol=1e-5)
    displacements = jnp.stack([CARRIED[0], CARRIED[1] - path_change])
    moments = jnp.stack([moment, jnp.zeros(2)])
    alone = bend_at_rest(
        displacements, moments, MATRICES, jnp.full(2, STIFFNESS), jnp.zeros(2)
    )
    np.testing.assert_allclose(result.bends, alone, atol=1e-5)


def test_the_sweeps_of_a_model_are_near_convergence():
    model = equilibrium(give=np.log(0.05), coupling=(0.15, 0.0))
    np.testing.assert_allclose(
        rest(model, 2 * SWEEPS).bends, rest(model).bends, atol=3e-3
    )


@pytest.mark.slow
def test_couplings_have_no_gradient_for_planning():
    model = equilibrium(give=np.log(0.05), coupling=(0.25, 0.0))

    def inner(carried, engaged):
        return rest(model, SWEEPS, carried, engaged).bends[0, 0]

    engaged = jax.grad(inner)(CARRIED, True)
    true = jax.grad(inner)(CARRIED, False)
    assert np.any(engaged[0] != 0.0)
    np.testing.assert_array_equal(engaged[1], 0.0)
    assert np.any(true[1] != 0.0)
