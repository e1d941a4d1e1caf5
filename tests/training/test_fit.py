"""Training loop on linear regression, with known weights."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array

from s2c2a.errors import TrainingError
from s2c2a.training import FitOptions, Fixed
from s2c2a.training.fit import fit

TRUE = np.array([[2.0, -1.0], [0.5, 3.0]], np.float32)
KEY = jax.random.key(0)
QUICK = FitOptions(
    learning_rate=0.01, batch_size=16, max_epochs=20, patience=100, epochs_per_call=5
)


class Line(eqx.Module):
    """y = x W."""

    weights: Array


def squared(model: Line, batch, key) -> Array:
    return jnp.mean((batch["inputs"] @ model.weights - batch["targets"]) ** 2)


def data(samples: int, seed: int, noise: float = 0.0) -> dict:
    random = np.random.default_rng(seed)
    inputs = random.normal(size=(samples, 2)).astype(np.float32)
    targets = inputs @ TRUE + noise * random.normal(size=(samples, 2)).astype(
        np.float32
    )
    return {"inputs": inputs, "targets": targets}


TRAINING, VALIDATION = data(128, 0), data(64, 1)
BLANK = Line(jnp.zeros((2, 2)))


class Fitted(NamedTuple):
    """What a fit gives."""

    network: Line
    curve: np.ndarray


def fitted(
    options=QUICK, loss=squared, training=TRAINING, key=KEY, network=BLANK, **changes
):
    return Fitted(*fit(network, loss, training, VALIDATION, options, key, **changes))


def with_options(**changes) -> FitOptions:
    return FitOptions(**{**vars(QUICK), **changes})


def test_both_losses_fall_with_every_epoch():
    curve = fitted().curve
    np.testing.assert_array_equal(curve[:, 0], np.arange(1, 21))
    assert np.all(np.diff(curve[:, 1]) < 0)
    assert np.all(np.diff(curve[:, 2]) < 0)
    assert curve[-1, 2] < 0.5 * curve[0, 2]


def test_enough_epochs_find_the_true_weights():
    result = fitted(
        with_options(max_epochs=300, epochs_per_call=100, learning_rate=0.03)
    )
    np.testing.assert_allclose(result.network.weights, TRUE, atol=1e-3)


def test_the_first_step_is_that_of_adam():
    """Adam's first step is the learning rate times the sign of the gradient."""
    one_batch = with_options(batch_size=128, max_epochs=1, epochs_per_call=1)
    np.testing.assert_allclose(
        fitted(one_batch).network.weights, 0.01 * np.sign(TRUE), rtol=1e-4
    )


def worse_later(model: Line, batch, key) -> Array:
    """Training loss that falls; validation loss that rises above a weight of 0.5."""
    training = squared(model, batch, key)
    return training if key is not None else (model.weights[0, 0] - 0.5) ** 2


def test_training_returns_the_weights_of_the_best_validation_loss():
    result = fitted(with_options(learning_rate=0.02, max_epochs=40), worse_later)
    best = result.curve[:, 2].min()
    assert result.curve[-1, 2] > 10 * best
    assert (result.network.weights[0, 0] - 0.5) ** 2 == pytest.approx(best, rel=1e-5)


@pytest.mark.parametrize("patience", [1, 4, 9])
def test_training_stops_after_patience_epochs_without_improvement(patience):
    options = with_options(
        learning_rate=0.02, max_epochs=400, patience=patience, epochs_per_call=1
    )
    curve = fitted(options, worse_later).curve
    assert len(curve) - (np.argmin(curve[:, 2]) + 1) == patience
    assert len(curve) < 60


@pytest.mark.parametrize(("max_epochs", "epochs_per_call"), [(10, 5), (1, 1), (7, 5)])
def test_training_never_exceeds_max_epochs(max_epochs, epochs_per_call):
    curve = fitted(
        with_options(max_epochs=max_epochs, epochs_per_call=epochs_per_call)
    ).curve
    assert len(curve) == max_epochs


def test_the_same_key_gives_the_same_result():
    one, two, other = (
        fitted(training=data(128, 0, 0.5), key=jax.random.key(seed))
        for seed in (3, 3, 4)
    )
    np.testing.assert_array_equal(one.network.weights, two.network.weights)
    np.testing.assert_array_equal(one.curve, two.curve)
    assert not np.array_equal(one.curve, other.curve)


def test_every_epoch_sees_every_sample_once():
    """With a rate of zero the mean training loss of an epoch is that of all samples."""
    curve = fitted(
        with_options(learning_rate=0.0, max_epochs=3, epochs_per_call=3)
    ).curve
    np.testing.assert_allclose(curve[:, 1], squared(BLANK, TRAINING, None), rtol=1e-5)


def test_progress_is_reported_before_the_first_call_and_after_each():
    told = []
    result = fitted(progress=lambda epoch, most, loss: told.append((epoch, most, loss)))
    assert [(epoch, most) for epoch, most, _ in told] == [
        (0, 20),
        (5, 20),
        (10, 20),
        (15, 20),
        (20, 20),
    ]
    np.testing.assert_allclose(
        [loss for *_, loss in told[1:]], result.curve[4::5, 2], rtol=1e-6
    )


def test_arrays_that_are_not_floating_point_are_not_trained():
    class Labeled(Line):
        count: Array
        name: str = eqx.field(static=True)

    result = fitted(network=Labeled(jnp.zeros((2, 2)), jnp.arange(3), "line"))
    np.testing.assert_array_equal(result.network.count, np.arange(3))
    assert result.network.name == "line"


def test_a_fixed_part_is_not_trained():
    class Unit(Fixed):
        scale: Array

    class Scaled(Line):
        unit: Unit

    def loss(model, batch, key):
        return squared(Line(model.weights * model.unit.scale), batch, key)

    result = fitted(loss=loss, network=Scaled(jnp.zeros((2, 2)), Unit(jnp.array(1.5))))
    assert result.network.unit.scale == 1.5
    assert result.curve[-1, 2] < result.curve[0, 2]


def test_fewer_samples_than_one_batch_are_refused():
    with pytest.raises(TrainingError, match=r"15 training samples.*16.*collect more"):
        fitted(training=data(15, 0))


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_loss_that_is_not_finite_is_reported(bad):
    broken = {**TRAINING, "targets": np.full((128, 2), bad, np.float32)}
    with pytest.raises(TrainingError, match="not finite"):
        fitted(training=broken)
