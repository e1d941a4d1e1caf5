"""From the start of a process to its end, and the most memory that it holds."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from s2c2a.strategies import save_networks

# Linux counts the memory of whoever starts a process as its own, but not here
STATUS = Path("/proc/self/status")
TELL = (
    f"import atexit; atexit.register(lambda: print(open({str(STATUS)!r}).read()))\n"
    if STATUS.is_file()
    else ""
)
HELP = "import sys; sys.argv[1:] = ['--help']; from s2c2a.cli.main import main; main()"
FIRST_TICK = Path(__file__).with_name("first_tick.py")
STARTS = 5


def start(
    benchmark, code: str, *arguments: str, rounds: int = STARTS, **environment: str
) -> None:
    """Time processes that run the code; JAX has a user's settings."""
    bare = {
        name: value for name, value in os.environ.items() if not name.startswith("JAX_")
    } | environment
    command = [sys.executable, "-c", TELL + code, *arguments]
    done = benchmark.pedantic(
        lambda: subprocess.run(
            command, env=bare, check=True, capture_output=True, text=True
        ),
        rounds=rounds,
    )
    if STATUS.is_file():
        peak = done.stdout.split("VmHWM:")[1].split()[0]
        benchmark.extra_info["peak memory [MiB]"] = int(peak) / 1024


@pytest.mark.asked("at most 0.6 s")
def test_help(benchmark):
    start(benchmark, HELP)


@pytest.mark.asked("at most 0.3 s")
def test_import(benchmark):
    start(benchmark, "import s2c2a")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where compiled programs are kept from the first start to the later ones."""
    return tmp_path_factory.mktemp("programs")


@pytest.mark.parametrize(
    "rounds", [pytest.param(1, id="first"), pytest.param(STARTS, id="later")]
)
def test_first_tick(benchmark, networks, folder, rounds):
    """A first start compiles everything; a later one is asked to take at most 3 s."""
    file = folder / "strategy.safetensors"
    cache = folder / networks.recipe.name
    save_networks(networks, file)
    start(
        benchmark,
        FIRST_TICK.read_text(),
        str(file),
        rounds=rounds,
        S2C2A_CACHE=str(cache),
    )
