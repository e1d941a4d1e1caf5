"""The benchmarks can be collected and run."""

import importlib
import json
import os
import subprocess
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

FOLDER = Path(__file__).parents[1] / "benchmarks"
LEFT = np.ones((3, 4), np.float32)
RIGHT = np.ones((4, 5), np.float32)
SQUARE = np.eye(6, dtype=np.float32)


@pytest.fixture
def count_operations(monkeypatch):
    monkeypatch.syspath_prepend(str(FOLDER))
    return importlib.import_module("operations").count_operations


def run(*arguments: str) -> subprocess.CompletedProcess:
    reason = "pytest-benchmark comes with the extras bench and dev"
    pytest.importorskip("pytest_benchmark", reason=reason)
    command = [sys.executable, "-m", "pytest", str(FOLDER), *arguments]
    # the subprocess must not take itself for a worker of pytest-xdist
    outer = [name for name in os.environ if name.startswith("PYTEST_")]
    environment = {name: os.environ[name] for name in os.environ.keys() - outer}
    return subprocess.run(
        command, env=environment, capture_output=True, text=True, check=False
    )


@pytest.mark.slow
def test_every_benchmark_runs(tmp_path):
    """Once and untimed, but for those that take minutes; the cheapest one is timed."""
    quick = "not growth and not batch and not live and not paper"
    done = run("--benchmark-disable", "-k", quick)
    assert done.returncode == 0, done.stdout + done.stderr
    written = tmp_path / "figures.json"
    options = ("--benchmark-max-time=0.01", f"--benchmark-json={written}")
    done = run("-k", "test_inverse_pcc", *options)
    assert "1 passed" in done.stdout, done.stdout + done.stderr
    figures = json.loads(written.read_text())
    assert [entry["name"] for entry in figures["benchmarks"]] == ["test_inverse_pcc"]
    assert figures["benchmarks"][0]["stats"]["median"] > 0
    assert figures["machine_info"]["arm"] == "twin_arm"
    assert "jax" in figures["machine_info"]["versions"]


@pytest.mark.slow
def test_a_missing_gpu_is_rejected():
    if any(device.platform == "gpu" for device in jax.devices()):
        pytest.skip("there is a GPU here")
    done = run("--device", "gpu", "--collect-only")
    assert done.returncode == 4
    assert "JAX finds no GPU here" in done.stderr


@pytest.mark.parametrize(
    ("function", "inputs", "counted"),
    [
        (
            jnp.matmul,
            (LEFT, RIGHT),
            {"arithmetic": 2 * 3 * 4 * 5, "bytes": 4 * (12 + 20 + 15)},
        ),
        (
            jax.vmap(lambda each: each @ RIGHT),
            (np.ones((7, 3, 4), np.float32),),
            {"arithmetic": 7 * 2 * 3 * 4 * 5},
        ),
        (
            lambda x: jnp.tanh(x * 2.0 + 1.0).sum(),
            (LEFT,),
            {"arithmetic": 12 + 12 + 12, "transcendental": 12},
        ),
        (
            lambda x: jax.lax.fori_loop(0, 10, lambda _, y: jnp.sin(y), x),
            (LEFT,),
            {"transcendental": 10 * 12},
        ),
        (
            lambda x: jax.lax.cond(x[0, 0] > 0.0, lambda: x * x * x * x, lambda: x + x),
            (LEFT,),
            {"arithmetic": 12 + 1, "transcendental": 0},
        ),
    ],
    ids=["product", "many products", "elements", "loop", "cheapest branch"],
)
def test_operation_counts_match_hand_counts(
    count_operations, function, inputs, counted
):
    found = count_operations(function, *inputs)
    assert {kind: found[kind] for kind in counted} == counted


def test_nested_programs_count_and_a_linear_solve_counts_once(count_operations):
    solve = jax.jit(lambda a: jnp.linalg.solve(a, a[0]))
    found = count_operations(solve, SQUARE)["arithmetic"]
    assert 2 / 3 * 6**3 <= found <= 2 / 3 * 6**3 + 3 * 36
