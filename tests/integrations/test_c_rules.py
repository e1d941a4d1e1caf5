import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from s2c2a.errors import S2C2AError
from s2c2a.integrations.c_code.interface import generate

from tools.c_step import COMPILER, CProgram

MATRIX = jnp.array([[4.0, 1.0, -0.5], [1.0, 5.0, 0.3], [-0.5, 0.3, 3.0]])


def looped(x):
    def body(carry, row):
        return carry * 0.5 + row, carry.sum() + row[::-1]

    last, rows = lax.scan(body, x[0], x[:, :], reverse=True)
    return jnp.concatenate([last, rows.ravel()])


def nested(x):
    def outer(carry, row):
        inner, _ = lax.scan(lambda c, r: (c + r * carry, None), row, x)
        return inner, inner * row

    return lax.scan(outer, x[1], x)[1]


OPERATIONS = {
    "elementwise": lambda x: jnp.tanh(x) * jnp.exp(-(x**2)) + jnp.sqrt(jnp.abs(x)) ** 3,
    "softplus": lambda x: jax.nn.softplus(x) + jax.nn.sigmoid(x) + jnp.arctan2(x, 1.5),
    "rows by columns": lambda x: x + x[:, :1] * x[:1] + x.sum(),
    "clipped": lambda x: (
        jnp.clip(x, -0.5, 0.5) + jnp.maximum(x, 0.1) + jnp.minimum(x, 2)
    ),
    "moved": lambda x: x.T[::-1].reshape(2, 6)[:, 1::2] + jnp.tile(x[0, :3], (2, 1)),
    "product": lambda x: x.T @ x + jnp.einsum("ab,cb->ac", x, x)[0, 0],
    "batched product": lambda x: jnp.einsum("bij,bjk->bik", x[:, :, None], x[:, None]),
    "long product": lambda x: jnp.tile(x.ravel(), 3) @ jnp.arange(72.0).reshape(36, 2),
    "reduced": lambda x: jnp.stack([x.max(0), x.min(0), x.prod(0), x.mean(0)]),
    "any": lambda x: ((x > 0).any(0) & ~(x > 9).all(0)).astype(jnp.float32),
    "accumulated": lambda x: jnp.cumsum(x, 0) + jnp.cumsum(x, 1)[:, ::-1],
    "extremes": lambda x: jnp.stack([x.argmin(1), x.argmax(1)]).astype(jnp.float32),
    "sorted": lambda x: jnp.sort(x, axis=1) + lax.top_k(x, 2)[0].sum(),
    "order": lambda x: jnp.argsort(x, axis=0).astype(jnp.float32) + lax.top_k(x, 1)[1],
    "gathered": lambda x: x[jnp.array([2, 0]), 1:] + jnp.take(x, 7, mode="fill"),
    "of an index": lambda x: x[jnp.argmax(x[:, 0])] + x.at[1].set(x[0]).sum(0),
    "scattered": lambda x: x.at[jnp.array([0, 0, 2])].add(x).at[1, 2].multiply(3.0),
    "dynamic": lambda x: lax.dynamic_slice(x, (x.argmax() % 2, 1), (2, 2)),
    "updated": lambda x: lax.dynamic_update_slice(x, x[:2, :2], (1, x.argmin() % 2)),
    "apart": lambda x: sum(jnp.unstack(x, axis=1)) + jnp.split(x, 2, axis=1)[1][:, 0],
    "padded": lambda x: jnp.pad(x, ((1, 0), (0, 2)), constant_values=7.0),
    "solved": lambda x: jnp.linalg.solve(MATRIX + x[:, :3] / 9.0, x[:, 0]),
    "factor": lambda x: jnp.linalg.cholesky(MATRIX) @ x,
    "triangular": lambda x: jax.scipy.linalg.solve_triangular(MATRIX, x, lower=True),
    "transposed": lambda x: jax.scipy.linalg.solve_triangular(MATRIX, x, trans=1),
    "branches": lambda x: lax.switch(
        (x[0, 0] > 0).astype(int), [lambda: x, lambda: 2.0 * x]
    ),
    "loop": lambda x: lax.while_loop(lambda c: c.sum() < 30.0, lambda c: c + 1.1, x),
    "empty": lambda x: x + (2.0 * x[:, :0]).sum(),
    "scan": looped,
    "nested scans": nested,
    "gradient": jax.grad(lambda x: jnp.sum(jnp.tanh(MATRIX @ x) ** 2)),
    "directions": lambda x: jax.vmap(lambda d: jax.jvp(jnp.sin, (x,), (d * x,))[1])(
        jnp.arange(3.0)
    ),
}


def everything(x):
    parts = [operation(x).ravel() for operation in OPERATIONS.values()]
    return jnp.concatenate([part.astype(jnp.float32) for part in parts])


def start(inputs):
    return {"sum": jnp.zeros(4), "count": jnp.zeros((), jnp.int32)}


def step(memory, inputs):
    x = inputs["x"] + 0.0 * memory["sum"]
    after = {"sum": memory["sum"] + x[0], "count": memory["count"] + 1}
    result = everything(x)
    counted = memory["count"].astype(jnp.float32)
    return jnp.concatenate([result, after["sum"], counted[None]]), after


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
def test_every_operation_is_that_of_jax(tmp_path):
    example = {"x": np.zeros((3, 4), np.float32)}
    generated = generate("rules", "A test.", start, step, example, lambda each: each)
    compiled = CProgram(generated, "rules", tmp_path, example)
    memory = start(example)
    compiled.start(example)
    random = np.random.default_rng(3)
    for _ in range(5):
        inputs = {"x": random.normal(size=(3, 4)).astype(np.float32)}
        expected, memory = step(memory, inputs)
        found = compiled.step(inputs, expected.shape)
        np.testing.assert_allclose(found, expected, rtol=2e-5, atol=2e-5)


def test_an_unknown_operation_is_named():
    def decomposed(memory, inputs):
        return jnp.linalg.eigh(inputs["x"] @ inputs["x"].T)[0], memory

    example = {"x": np.zeros((3, 4), np.float32)}
    with pytest.raises(S2C2AError, match="'eigh' cannot be exported to C"):
        generate("bad", "A test.", start, decomposed, example, lambda each: each)


def test_a_name_is_one_of_c():
    with pytest.raises(S2C2AError, match="'2 arms' is no name in C"):
        generate("2 arms", "A test.", start, step, {}, lambda each: each)
