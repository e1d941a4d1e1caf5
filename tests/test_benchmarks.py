"""The benchmarks can be collected and run."""

import json
import os
import subprocess
import sys
from pathlib import Path

import jax
import pytest

FOLDER = Path(__file__).parents[1] / "benchmarks"


def run(*arguments: str) -> subprocess.CompletedProcess:
    command = [sys.executable, "-m", "pytest", str(FOLDER), *arguments]
    # the subprocess must not take itself for a worker of pytest-xdist
    environment = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith("PYTEST_")
    }
    return subprocess.run(
        command, env=environment, capture_output=True, text=True, check=False
    )


@pytest.mark.slow
def test_every_benchmark_runs(tmp_path):
    """Once and untimed, but for those that take minutes; the cheapest one is timed."""
    pytest.importorskip(
        "pytest_benchmark",
        reason="pytest-benchmark comes with the extras bench and dev",
    )
    done = run(
        "--benchmark-disable",
        "-k",
        "not growth and not batch and not live and not paper",
    )
    assert done.returncode == 0, done.stdout + done.stderr
    written = tmp_path / "figures.json"
    done = run(
        "-k",
        "test_inverse_pcc",
        "--benchmark-max-time=0.01",
        f"--benchmark-json={written}",
    )
    assert "1 passed" in done.stdout, done.stdout + done.stderr
    figures = json.loads(written.read_text())
    assert [entry["name"] for entry in figures["benchmarks"]] == ["test_inverse_pcc"]
    assert figures["benchmarks"][0]["stats"]["median"] > 0
    assert figures["machine_info"]["arm"] == "twin_arm"
    assert "jax" in figures["machine_info"]["versions"]


@pytest.mark.slow
def test_a_missing_gpu_is_rejected():
    pytest.importorskip(
        "pytest_benchmark",
        reason="pytest-benchmark comes with the extras bench and dev",
    )
    if any(device.platform == "gpu" for device in jax.devices()):
        pytest.skip("there is a GPU here")
    done = run("--device", "gpu", "--collect-only")
    assert done.returncode == 4
    assert "JAX finds no GPU here" in done.stderr
