"""Gymnasium finds the environments, whatever is imported first."""

import subprocess
import sys

import pytest

from marks import slow_after

MAKE = "environment = gymnasium.make('s2c2a:S2C2A/Reach-v0', arm='planar_finger'); "
SHOW = "print(type(environment.unwrapped).__name__)"


def printed(code: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True
    )
    return done.stdout.strip()


def test_the_package_alone_loads_neither_gymnasium_nor_a_slow_module():
    slow = "{'gymnasium', 'importlib.resources'}"
    assert printed(f"import sys, s2c2a; print({slow} & sys.modules.keys())") == "set()"


@pytest.mark.parametrize(
    "imports", slow_after(1, ["gymnasium, s2c2a", "s2c2a, gymnasium", "gymnasium"])
)
def test_environments_are_found_in_every_order_of_imports(imports):
    pytest.importorskip("gymnasium")
    assert printed(f"import {imports}; {MAKE}{SHOW}") == "ArmEnv"


def test_a_missing_package_stays_missing():
    code = (
        "from s2c2a.execution.after_import import import_after\n"
        "import_after('no_such_package', 'json')\n"
        "try:\n    import no_such_package\n"
        "except ModuleNotFoundError as error:\n    print(error.name)"
    )
    assert printed(code) == "no_such_package"
