"""The distributions: what they hold, and a wheel that works outside the checkout."""

import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import venv
from functools import partial
from importlib.metadata import distribution
from pathlib import Path
from zipfile import ZipFile

import pytest
from packaging.requirements import Requirement

from s2c2a import __version__
from s2c2a.cli.main import main
from test_house import WINGS

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "s2c2a"
WEIGHTS = "s2c2a/strategies/weights/"
MAX_BYTES = 5_000_000
SMOKE = """
from importlib.metadata import version
from pathlib import Path
import s2c2a
from s2c2a.arm import load_arm
from s2c2a.strategies.shipped import shipped_networks
assert s2c2a.__version__ == version("s2c2a")
assert Path(s2c2a.__file__).is_relative_to({environment!r}), s2c2a.__file__
for name in ("twin_arm", "simulated_arm"):
    shipped_networks(load_arm(name))
"""
CORE = """
from importlib.util import find_spec
import s2c2a
for name in ("lab", "logs", "live", "integrations"):
    assert find_spec(f"s2c2a.{name}") is None, name
for name in ("viser", "cv2", "serial", "distributed", "pytest"):
    assert find_spec(name) is None, name
arm = s2c2a.load_arm("twin_arm")
recording = s2c2a.collect(arm, "one.episodes", episodes=1, samples=8)
assert recording.actions.shape[:2] == (1, 8)
assert s2c2a.load_strategy("shipped", arm).name == "s2c2a"
"""


def build(folder: Path, source: Path = ROOT) -> tuple[Path, Path]:
    """Build a wheel and a source distribution, without a network."""
    command = [sys.executable, "-m", "hatchling", "build", "-d", str(folder)]
    subprocess.run(command, cwd=source, check=True, capture_output=True)
    (wheel,) = folder.glob("*.whl")
    (sdist,) = folder.glob("*.tar.gz")
    return wheel, sdist


@pytest.fixture(scope="module")
def distributions(tmp_path_factory) -> tuple[Path, Path]:
    """A wheel and a source distribution of the checkout."""
    return build(tmp_path_factory.mktemp("dist"))


@pytest.fixture(scope="module")
def environment(distributions, tmp_path_factory) -> Path:
    """A virtual environment with the wheel, and with the packages of this one.

    No file of this environment other than its packages is seen: paths of editable
    installations are not, since Python reads no .pth of a folder that a .pth names.
    """
    folder = tmp_path_factory.mktemp("environment")
    own_packages = installed_alone(distributions[0], folder)
    packages = [path for path in sys.path if path.endswith("-packages")]
    (own_packages / "outside.pth").write_text("\n".join(packages))
    return folder


def installed_alone(wheel: Path, folder: Path) -> Path:
    """Make a virtual environment with nothing but a wheel; returns its packages."""
    venv.create(folder, symlinks=os.name != "nt")
    python = _program(folder, "python")
    install = ["pip", "--python", str(python), "install", "--quiet"]
    no_network = ["--no-deps", "--no-index", str(wheel)]
    subprocess.run([sys.executable, "-m", *install, *no_network], check=True)
    code = "import sysconfig; print(sysconfig.get_path('purelib'))"
    asked = subprocess.run(
        [python, "-c", code], check=True, capture_output=True, text=True
    )
    return Path(asked.stdout.strip())


@pytest.fixture(scope="module")
def core_environment(distributions, tmp_path_factory) -> Path:
    """A virtual environment with the core and its dependencies, without the wings."""
    folder = tmp_path_factory.mktemp("core")
    packages = installed_alone(distributions[0], folder)
    for wing in WINGS:
        shutil.rmtree(packages / "s2c2a" / wing)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    for name in dependencies_of(project["project"]["dependencies"]):
        link_distribution(name, packages)
    return folder


def dependencies_of(requirements: list[str]) -> set[str]:
    """Names of all distributions that requirements need, without extras of their own."""
    found = set()
    pending = [Requirement(text) for text in requirements]
    while pending:
        requirement = pending.pop()
        is_needed = requirement.marker is None or requirement.marker.evaluate()
        if not is_needed or requirement.name in found:
            continue
        found.add(requirement.name)
        further = distribution(requirement.name).requires or []
        pending += [Requirement(text) for text in further]
    return found


def link_distribution(name: str, packages: Path) -> None:
    """Link the top-level files and folders of an installed distribution."""
    for file in distribution(name).files:
        top = file.parts[0]
        if top in ("..", "__pycache__") or (packages / top).exists():
            continue
        (packages / top).symlink_to(Path(distribution(name).locate_file(top)))


def _program(environment: Path, name: str) -> Path:
    return environment / ("Scripts" if os.name == "nt" else "bin") / name


def run_outside(environment: Path, folder: Path, *command: str) -> str:
    """Run a program of the environment in an empty folder; returns its output."""
    variables = os.environ | {"S2C2A_CACHE": str(folder / "cache")}
    variables.pop("PYTHONPATH", None)
    name, *arguments = command
    done = subprocess.run(
        [_program(environment, name), *arguments],
        cwd=folder,
        env=variables,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def package_files(wheel: Path) -> dict[str, int]:
    """Sizes of the wheel's files in bytes as compressed, without the metadata."""
    with ZipFile(wheel) as archive:
        return {
            entry.filename: entry.compress_size
            for entry in archive.infolist()
            if ".dist-info/" not in entry.filename
        }


@pytest.mark.slow
def test_the_wheel_holds_every_file_of_the_package_and_no_other(distributions):
    tracked = {
        f"s2c2a/{path.relative_to(SOURCE).as_posix()}"
        for path in SOURCE.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert set(package_files(distributions[0])) == tracked


def test_the_source_distribution_holds_no_plugins(distributions):
    with tarfile.open(distributions[1]) as archive:
        assert not [name for name in archive.getnames() if "/plugins/lerobot" in name]


@pytest.mark.slow
def test_the_wheel_is_small_without_the_weights(distributions):
    sizes = package_files(distributions[0])
    code = [size for name, size in sizes.items() if not name.startswith(WEIGHTS)]
    assert sum(code) <= MAX_BYTES


@pytest.mark.slow
def test_the_source_distribution_builds_the_same_wheel(distributions, tmp_path):
    wheel, sdist = distributions
    with tarfile.open(sdist) as archive:
        archive.extractall(tmp_path, filter="data")
    (source,) = tmp_path.iterdir()
    assert not (source / "tests").exists()
    assert not (source / "docs").exists()
    rebuilt, _ = build(tmp_path / "dist", source)
    with ZipFile(wheel) as first, ZipFile(rebuilt) as second:
        assert set(first.namelist()) == set(second.namelist())
        for name in first.namelist():
            assert first.read(name) == second.read(name), name


@pytest.mark.slow
def test_the_wheel_works_outside_the_checkout(environment, tmp_path):
    code = SMOKE.format(environment=str(environment))
    run_outside(environment, tmp_path, "python", "-c", code)
    assert __version__ in run_outside(environment, tmp_path, "s2c2a", "--version")
    checked = run_outside(environment, tmp_path, "s2c2a", "arm", "check", "twin_arm")
    assert "twin_arm is valid" in checked


@pytest.mark.slow
def test_the_core_runs_with_its_own_dependencies_and_without_the_wings(
    core_environment, tmp_path
):
    run_here = partial(run_outside, core_environment, tmp_path)
    run_here("python", "-c", CORE)
    assert "--help" in run_here("s2c2a", "--help")
    run_here(
        *["s2c2a", "run", "circle", "--pace", "10", "--strategy", "pcc", "--out", "run"]
    )
    assert (tmp_path / "run" / "twin_arm.episodes").is_file()


def test_the_dockerfile_copies_existing_files_that_the_build_context_holds():
    ignored = (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines()
    # the last one is the target
    copied = [name for _, *names in _instructions("COPY") for name in names[:-1]]
    assert copied
    for name in copied:
        assert (ROOT / name).exists(), name
        assert f"!{name}" in ignored


def test_the_command_of_the_dockerfile_opens_the_page(monkeypatch):
    class PageOpenedError(Exception):
        pass

    def page(arm, robot, port, *_, host, **__):
        raise PageOpenedError(host, str(port))

    monkeypatch.setattr("s2c2a.live.cli.live.running_page", page)
    ((_, *words),) = _instructions("ENTRYPOINT")
    program, *arguments = re.findall(r'"([^"]*)"', " ".join(words))
    assert program == "s2c2a"
    ((_, port),) = _instructions("EXPOSE")
    with pytest.raises(PageOpenedError) as opened:
        main(arguments)
    assert opened.value.args == ("0.0.0.0", port)


def test_the_citation_names_the_newest_release():
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    release = re.search(r"^## \[(\d+\.\d+\.\d+)\](?: - (\S+))?$", changes, re.M)
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    version = re.search(r"^version: (\S+)$", citation, re.M)
    date = re.search(r"^date-released: \"?([\d-]+)\"?$", citation, re.M)
    assert version[1] == release[1]
    assert (date and date[1]) == release[2]


def _instructions(name: str) -> list[list[str]]:
    """Instructions of the Dockerfile with this name, as words."""
    lines = (ROOT / "Dockerfile").read_text(encoding="utf-8").splitlines()
    return [line.split() for line in lines if line.startswith(f"{name} ")]


def test_the_page_of_the_installation_lists_every_extra():
    page = (ROOT / "docs" / "get-started" / "installation.md").read_text("utf-8")
    _, _, table = page.partition("\n## Extras\n")
    rows = re.findall(r"^\| `(\w+)` \|", table.partition("\n## ")[0], re.MULTILINE)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    extras = project["optional-dependencies"]
    assert sorted(rows) == sorted(extras)
    parts = map(Requirement, extras["dev"])
    in_dev = {extra for part in parts if part.name == "s2c2a" for extra in part.extras}
    (row,) = re.findall(r"(?m)^\| `dev` \| all of these except (.*), and", table)
    assert set(rows) - in_dev - {"dev"} == set(re.findall(r"`(\w+)`", row))
