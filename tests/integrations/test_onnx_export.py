import jax
import numpy as np
import onnx
import pytest

from s2c2a.arm import arm_from_toml, load_arm
from s2c2a.errors import S2C2AError
from s2c2a.integrations.exports.onnx_models import (
    check_model,
    export_onnx,
    onnx_of,
    parts_of,
)
from s2c2a.integrations.exports.plain_jaxpr import plain_function
from s2c2a.strategies import networks_from, save_networks
from s2c2a.strategies.pcc import pcc_strategy


@pytest.fixture(scope="module")
def strategy():
    return pcc_strategy(load_arm("twin_arm"))


def test_the_models_are_read_by_onnx_runtime_and_equal_jax(strategy):
    for part in parts_of(strategy):
        model = onnx_of(part, {"origin": "a test"})
        onnx.checker.check_model(onnx.load_from_string(model))
        check_model(part, model, strategy)  # raises where they differ


def test_functions_of_jax_stay_as_they_were(strategy):
    before = dict(vars(jax.numpy))
    onnx_of(parts_of(strategy)[1], {})
    assert all(vars(jax.numpy)[name] is value for name, value in before.items())


def test_a_model_that_differs_from_jax_is_refused(strategy):
    predict, _ = parts_of(strategy)
    model = onnx_of(predict, {})

    def doubled(**inputs):
        return jax.tree.map(lambda values: 2.0 * values, predict.function(**inputs))

    with pytest.raises(S2C2AError, match=r"differs from JAX by .* Use --to c"):
        check_model(predict._replace(function=doubled), model, strategy)


@pytest.mark.slow
def test_the_shipped_networks_are_exported(tmp_path):
    arm = load_arm("twin_arm")
    weights = tmp_path / "mine.safetensors"
    save_networks(networks_from("shipped", arm), weights)
    text = export_onnx(weights, tmp_path / "mine.onnx")
    assert text == "models forward_model and controller"
    model = onnx.load(tmp_path / "mine.controller.onnx")
    texts = {each.key: each.value for each in model.metadata_props}
    assert arm_from_toml(texts["arm"], "arm") == arm
    inputs = [each.name for each in model.graph.input]
    assert "desired" in inputs
    assert "memory_inner_actions" in inputs
    assert {f"{name}_out" for name in inputs if name.startswith("memory")} <= {
        each.name for each in model.graph.output
    }


def test_plain_functions_are_those_of_their_jaxprs():
    def nested(x):
        def outer(carry, row):
            inner, rows = jax.lax.scan(
                lambda c, r: (c + r, c * r), carry, x, reverse=True
            )
            return inner, rows.sum() * row

        last, rows = jax.lax.scan(outer, x[0], x, reverse=True)
        small = jax.lax.while_loop(lambda c: c.sum() > 1.0, lambda c: 0.5 * c, last)
        chosen = jax.lax.cond(small[0] > 0.2, lambda c: c, lambda c: -c, small)
        empty = jax.numpy.concatenate([rows, rows[:0]])
        matrix = jax.numpy.eye(2) + empty[:2, :2] / 9.0
        return chosen, jax.numpy.linalg.solve(matrix, empty[0])

    x = np.random.default_rng(1).uniform(0.1, 1.0, (3, 2)).astype(np.float32)
    plain = plain_function(jax.make_jaxpr(nested)(x))
    for found, expected in zip(plain(x), nested(x), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-5)
    text = str(jax.make_jaxpr(plain)(x))
    assert "reverse=True" not in text
    assert "custom_linear_solve" not in text
