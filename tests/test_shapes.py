"""Shapes and types of arguments, checked while unit tests run, by jaxtyping and beartype."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
CHECKED = "s2c2a.estimation,beartype.beartype"
UNIT_TESTS = (
    "test_kalman",
    "test_sensor_models",
    "test_modal_model",
    "test_disturbance_filter",
    "test_configuration_maps",
)


def test_the_estimation_package_keeps_its_annotations():
    files = [f"tests/estimation/{name}.py" for name in UNIT_TESTS]
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    result = subprocess.run(
        [*command, f"--jaxtyping-packages={CHECKED}", *files],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert result.returncode == 0, result.stdout[-4000:]
