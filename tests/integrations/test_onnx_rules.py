import jax
import jax.numpy as jnp
import numpy as np
import onnx
import pytest
from jax import lax
from test_c_rules import OPERATIONS

from s2c2a.errors import S2C2AError
from s2c2a.integrations.exports.onnx_models import runner
from s2c2a.integrations.onnx_code.model import Port, model_of

from marks import slow_after

GRID = jnp.array([-np.inf, -2.0, -1e-5, -0.0, 0.0, 1e-5, 0.7, 3.0, np.inf, np.nan])
MORE = {
    "arc tangents": lambda x: jnp.arctan2(GRID[:, None], GRID) + x[0, 0],
    "logarithms": lambda x: jnp.log1p(1e-4 * jnp.abs(x)) + jnp.expm1(1e-4 * x),
    "not numbers": lambda x: jnp.maximum(GRID, x[0, 0]) + jnp.isfinite(GRID + x[0, 1]),
    "extremes of not numbers": lambda x: (
        jnp.argmin(GRID * x[0, 0]) + jnp.max(GRID * x[0, 1])
    ),
    "remainders": lambda x: lax.rem(x, 0.3) + lax.rem(lax.round(9.0 * x), 4.0),
    "integers": lambda x: (
        (x * 9.0).astype(int) // 2 + (x > 0) * 3 - jnp.sign(x).astype(int)
    ),
    "powers": lambda x: x**7 + (x + 9.0) ** -3 + jnp.cbrt(x) + lax.rsqrt(x**2 + 1.0),
    "three branches": lambda x: lax.switch(
        jnp.int32(x[0, 0] * 3.0), [lambda: x, lambda: 2.0 * x, lambda: -x]
    ),
    "three cases": lambda x: lax.select_n(jnp.int32(jnp.abs(x)) % 3, x, 2.0 * x, -x),
    "accumulated products": lambda x: (
        lax.cumprod(x, 0) + lax.cummax(x, 1) + lax.cummin(x, 0, reverse=True)
    ),
    "spread": lambda x: lax.pad(x, 7.0, ((1, 0, 2), (0, 2, 1))),
    "outside": lambda x: (
        x.at[jnp.int32(x[0, 0] * 9.0), 1:].set(5.0).at[7].add(1.0, mode="drop")
    ),
    "sorted by": lambda x: lax.sort([x[0], x[1], x[2]], num_keys=1)[2],
    "batched factors": lambda x: jax.scipy.linalg.lu_factor(
        x[:, None, :3] * x[:, :3, None] + jnp.eye(3)
    )[0],
    "nothing": lambda x: lax.scan(lambda c, _: (c + 1.0, c), x, length=0)[0],
    "counted": lambda x: lax.fori_loop(0, 3, lambda i, c: c * 0.5 + i, x),
}


@pytest.fixture(scope="module")
def run_all():
    operations = OPERATIONS | MORE

    def everything(x):
        return [operation(x) for operation in operations.values()]

    example = np.zeros((3, 4), np.float32)
    names = [Port(name.replace(" ", "_")) for name in operations]
    model = model_of("all", everything, [example], [Port("x")], names, "", {})
    onnx.checker.check_model(onnx.load_from_string(model), full_check=True)
    run = runner(model)
    return lambda x: dict(zip(operations, run({"x": x}), strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("seed", slow_after(1, range(3)))
def test_every_operation_is_that_of_jax(run_all, seed):
    x = np.random.default_rng(seed).normal(size=(3, 4)).astype(np.float32)
    found = run_all(x)
    for name, operation in (OPERATIONS | MORE).items():
        expected = np.asarray(operation(jnp.asarray(x)))
        assert found[name].dtype == expected.dtype, name
        np.testing.assert_allclose(
            found[name], expected, rtol=2e-5, atol=2e-5, err_msg=name
        )


def test_an_unknown_operation_is_named():
    x = np.eye(3, dtype=np.float32)
    with pytest.raises(S2C2AError, match="'eigh' cannot be exported to ONNX"):
        model_of(
            "bad", lambda x: jnp.linalg.eigh(x), [x], [Port("x")], [Port("y")], "", {}
        )
