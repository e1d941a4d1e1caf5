"""Training of the chain on synthetic arcs with backlash and elastic cables."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.arm import ArmGeometry
from s2c2a.kinematics import configurations_from_bends, states_from_bends
from s2c2a.models import ChainOptions
from s2c2a.training import FitOptions, TrainingData

EPISODES, SAMPLES = 6, 200
GAIN = 0.8
PLAY = 0.06
SIZE = ChainOptions(
    hidden=8, depth=1, play_widths=(0.03, 0.05, 0.07), creep_times=(2.0,)
)
MEMORYLESS = replace(SIZE, play_widths=(), creep_times=())
OPTIONS = FitOptions(learning_rate=3e-3, max_epochs=20, epochs_per_call=20, decay=True)
predict = eqx.filter_jit(
    lambda model, configurations, memory: model.predict(configurations, memory)
)
as_seen = jax.jit(
    lambda bends, true, lengths: (
        configurations_from_bends(bends),
        states_from_bends(true, lengths),
    )
)


def synthetic(arm, seed=0, samples=SAMPLES, episodes=EPISODES):
    """Random sensed configurations, and states of arcs with backlash and a gain."""
    geometry = ArmGeometry.of(arm)
    random = np.random.default_rng(seed)
    goals = random.uniform(
        -0.5, 0.5, (episodes, samples // 10 + 1, arm.module_count, 2)
    )
    goals[:, 0] = 0.0
    shares = np.linspace(0, 1, 10, endpoint=False)[:, None, None]
    # (episodes, goals, 10, modules, 2)
    legs = goals[:, :-1, None] * (1 - shares) + goals[:, 1:, None] * shares
    bends = legs.reshape(episodes, -1, arm.module_count, 2)
    desired = np.einsum("mnk,esmk->esmn", geometry.cable_matrices, bends)
    carried = [desired[:, 0]]
    for now in np.moveaxis(desired, 1, 0)[1:]:
        carried.append(np.clip(carried[-1], now - PLAY, now + PLAY))
    true = GAIN * np.einsum(
        "mkn,esmn->esmk", geometry.bend_matrices, np.stack(carried, axis=1)
    )
    sensed, states = as_seen(
        *(values.astype(np.float32) for values in (bends, true, geometry.lengths))
    )
    return np.asarray(sensed), np.asarray(states)


def of(arm, sensed, states) -> TrainingData:
    """Training data without actions, since the chain uses none."""
    return TrainingData(
        arm, sensed, np.zeros((*sensed.shape[:-1], arm.cable_count)), states
    )


def train(arm, size=SIZE, seed=0, options=OPTIONS):
    return size.train(of(arm, *synthetic(arm)), options, jax.random.key(seed))


@pytest.fixture(scope="module")
def trained(make_arm):
    """Two modules of three pulling cables."""
    return train(make_arm(2))


def test_memory_reduces_the_error_on_backlash(trained, make_arm):
    without = train(make_arm(2), MEMORYLESS)
    assert trained.percent[0] < 0.5 * without.percent[0]
    assert trained.percent[0] < 1.0


def test_targets_stay_beside_their_inputs_in_every_stretch(trained, make_arm):
    """The test error, computed again along whole episodes."""
    model = trained.network
    sensed, states = synthetic(make_arm(2))

    def step(memory, now):
        return jax.vmap(model.observe)(now, memory), jax.vmap(model.predict)(
            now, memory
        )

    moved = jnp.moveaxis(jnp.asarray(sensed), 1, 0)
    along = jax.jit(lambda m: jax.lax.scan(step, jax.vmap(model.start)(m[0]), m)[1])(
        moved
    )
    held_out = np.moveaxis(np.asarray(along), 0, 1)[:, 170:] - states[:, 170:]
    percent = 100 * np.abs(held_out) / np.ptp(states.reshape(-1, 2, 6), axis=0)
    assert trained.percent[0] == pytest.approx(percent.mean(), rel=1e-2)


@pytest.mark.parametrize(
    ("modules", "cables", "changes"),
    [
        (2, 5, {"sensing": "true"}),
        pytest.param(2, 4, {}, marks=pytest.mark.slow),
        pytest.param(
            1,
            4,
            {
                "actuation": "tension",
                "module": {"pretension": 20.0, "tension_range": 20.0},
            },
            marks=pytest.mark.slow,
        ),
    ],
)
def test_other_arms_are_learned_too(make_arm, modules, cables, changes):
    arm = make_arm(modules, cables, **changes)
    model = train(arm, options=replace(OPTIONS, max_epochs=3, epochs_per_call=3))
    assert np.isfinite(model.curve).all()
    assert model.percent[0] < 4.0


def test_beyond_its_data_the_physics_predict(make_arm):
    arm = make_arm(2)
    sensed, states = synthetic(arm)
    near = np.abs(sensed[..., :2]).max(axis=(2, 3)) < 0.3
    hidden = np.where(near[..., None, None], states, np.nan)
    model = SIZE.train(of(arm, sensed, hidden), OPTIONS, jax.random.key(0)).network
    predicted = SIZE.predictions(model, of(arm, sensed, states))
    errors = np.linalg.norm((predicted - states)[:, :, -1, :3], axis=-1)
    assert errors[~near].mean() < 0.0025  # 5.2 mm if all is trained at once
