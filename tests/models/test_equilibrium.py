"""What modules do to each other at rest: shorten, lead each other's cables, and be bent by them."""

import jax
import jax.numpy as jnp
import numpy as np

from s2c2a.arm.geometry import cable_matrix
from s2c2a.models.statics import GIVE_UNIT, Equilibrium, bend_at_rest

MATRICES = jnp.asarray(
    cable_matrix(np.deg2rad(np.tile([0.0, 120.0, 240.0], (2, 1)))), jnp.float32
)
STIFFNESS, NO_GIVE = 4.0, -30.0
CARRIED = jnp.array([[-0.4, 0.3, 0.3], [-0.2, 0.4, 0.4]], jnp.float32)
NONE = jnp.zeros((2, 2))


def equilibrium(give=NO_GIVE, coupling=(0.0, 0.0)) -> Equilibrium:
    log_stiffness, zeros = jnp.full(2, np.log(STIFFNESS)), jnp.zeros(2)
    return Equilibrium(
        log_stiffness,
        zeros,
        jnp.full(2, give / GIVE_UNIT),
        jnp.array(coupling),
        jnp.zeros((2, 1)),
    )


def rest(one: Equilibrium, calls=30, engaged=False):
    settled = jax.jit(
        lambda before: one.settled(CARRIED, NONE, MATRICES, before, engaged)
    )
    found = one.settled(CARRIED, NONE, MATRICES, None, engaged)
    for _ in range(calls):
        found = settled(found)
    return found


def test_modules_that_do_nothing_to_each_other_rest_alone():
    alone = bend_at_rest(CARRIED, NONE, MATRICES, jnp.full(2, STIFFNESS), jnp.zeros(2))
    np.testing.assert_allclose(rest(equilibrium()).bends, alone, atol=1e-6)


def test_all_cables_through_a_module_shorten_it_and_let_go_of_those_further_out():
    give, found = 0.05, rest(equilibrium(give=np.log(0.05)))
    displaced = CARRIED + found.slack
    stretched = jnp.einsum("mnk,mk->mn", MATRICES, found.bends) - displaced
    pulls = STIFFNESS * np.maximum(stretched, 0.0).sum(axis=-1)
    np.testing.assert_allclose(
        found.shorter, give * np.array([pulls.sum(), pulls[1]]), rtol=1e-4
    )
    np.testing.assert_allclose(found.slack[:, 0], np.cumsum(found.shorter), rtol=1e-4)
    assert np.all(
        np.linalg.norm(found.bends, axis=-1)
        < np.linalg.norm(rest(equilibrium()).bends, axis=-1)
    )


def test_outer_cables_are_led_by_an_inner_bend_and_bend_it_themselves():
    coupling, found = 0.25, rest(equilibrium(coupling=(0.25, 0.0)))
    led = coupling * jnp.einsum("nk,k->n", MATRICES[1], found.bends[0])
    stretched = np.maximum(MATRICES[1] @ found.bends[1] - (CARRIED[1] - led), 0.0)
    moment = -coupling * STIFFNESS * MATRICES[1].T @ stretched
    np.testing.assert_allclose(found.pulled[0], -moment, atol=1e-5)
    displaced = jnp.stack([CARRIED[0], CARRIED[1] - led])
    moments = jnp.stack([moment, jnp.zeros(2)])
    alone = bend_at_rest(
        displaced, moments, MATRICES, jnp.full(2, STIFFNESS), jnp.zeros(2)
    )
    np.testing.assert_allclose(found.bends, alone, atol=1e-5)


def test_two_calls_are_near_where_many_end():
    one = equilibrium(give=np.log(0.05), coupling=(0.15, 0.0))
    np.testing.assert_allclose(rest(one, calls=1).bends, rest(one).bends, atol=3e-3)


def test_what_modules_do_to_each_other_has_no_slope_for_planning():
    one = equilibrium(give=np.log(0.05), coupling=(0.25, 0.0))

    def inner(carried, engaged):
        return one.settled(carried, NONE, MATRICES, None, engaged).bends[0, 0]

    engaged, true = (jax.grad(inner)(CARRIED, flag) for flag in (True, False))
    assert np.any(engaged[0] != 0.0)
    np.testing.assert_array_equal(engaged[1], 0.0)
    assert np.any(true[1] != 0.0)
