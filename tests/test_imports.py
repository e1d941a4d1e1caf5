"""Imports load what they need, and the core runs where its wings are missing."""

import importlib
import json
import pkgutil
import re
import subprocess
import sys
from pathlib import Path

import pytest

import s2c2a
from s2c2a.errors import S2C2AError
from test_house import WINGS, code_lines

MAX_MODULES = 63
MAX_LINES = 6550
LOADED = """
import json, sys
import {package}
print(json.dumps({{
    name: getattr(module, "__file__", None) for name, module in sys.modules.items()
}}))
"""


def loaded(package: str) -> dict[str, str | None]:
    """Names and files of all modules that `import PACKAGE` loads."""
    done = subprocess.run(
        [sys.executable, "-c", LOADED.format(package=package)],
        check=True,
        capture_output=True,
        text=True,
    )
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def loaded_by_planning() -> dict[str, str | None]:
    return loaded("s2c2a.planning")


def test_planning_loads_no_wing_and_no_simulation(loaded_by_planning):
    wings = tuple(f"s2c2a.{wing}" for wing in WINGS)
    foreign = ("mujoco", "s2c2a.robots", "s2c2a.runtime", "s2c2a.data", *wings)
    assert [name for name in loaded_by_planning if name.startswith(foreign)] == []


def test_planning_loads_a_small_part_of_the_package(loaded_by_planning):
    files = [
        Path(file)
        for name, file in loaded_by_planning.items()
        if name.partition(".")[0] == "s2c2a"
    ]
    lines = sum(len(code_lines(file.read_text(encoding="utf-8"))) for file in files)
    assert 20 < len(files) <= MAX_MODULES
    assert 2000 < lines <= MAX_LINES


@pytest.mark.parametrize(
    ("package", "large"),
    [
        ("s2c2a", {"jax", "mujoco", "numpy"}),
        ("s2c2a.viz", {"matplotlib", "jax", "scipy"}),
    ],
)
def test_a_package_loads_no_large_one_before_its_use(package, large):
    names = loaded(package)
    assert "s2c2a.execution.jax_settings" in names
    assert (large | {"mujoco"}).isdisjoint(names)


WITHOUT_WINGS = """
import sys
class Refusal:
    def find_spec(self, name, path=None, target=None):
        if any(f"{name}.".startswith(f"{refused}.") for refused in %r):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Refusal())
from s2c2a.cli.main import main
main(sys.argv[1:])
"""
DEVICES = ("viser", "cv2", "serial")


def test_the_core_runs_where_wings_and_drivers_are_missing(tmp_path):
    (tmp_path / "path.csv").write_text("time,x,y,z\n0,0,0,0.6\n0.5,0.02,0,0.59\n")
    refused = [*(f"s2c2a.{wing}" for wing in WINGS), *DEVICES]
    arguments = ["run", "path.csv", "--strategy", "pcc", "--out", "run"]
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_WINGS % refused, *arguments],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    # commands of what is missing are named, and the others work
    assert "the command 'live' cannot be loaded" in done.stderr
    assert (tmp_path / "run" / "twin_arm.episodes").is_file()


def test_every_module_is_imported():
    """Commands import figures where they draw them, and slow tests alone draw all."""
    packages = pkgutil.walk_packages(s2c2a.__path__, "s2c2a.")
    names = [each.name for each in packages if not each.name.endswith("__main__")]
    assert len(names) > 300
    missing = re.compile("No module named '(?!s2c2a)")
    faults = {}
    for name in names:
        try:
            importlib.import_module(name)
        except (ImportError, S2C2AError) as error:
            if not missing.search(str(error)):
                faults[name] = error
    assert faults == {}
