"""What many tests share: arms, a small recording, small networks."""

import ctypes
import gc
import json
import os
import signal
from contextlib import suppress
from hashlib import blake2b
from pathlib import Path
from shutil import rmtree

import jax
import numpy as np
import pytest
from hypothesis import settings as example_settings
from safetensors import safe_open
from safetensors.numpy import load_file, save

from s2c2a.arm import ArmSpec, Module, load_arm
from s2c2a.cli.main import main
from s2c2a.data import Recording, load_recording
from s2c2a.episodes import Episode
from s2c2a.execution.compilation import forget_programs
from s2c2a.plugins.discovery import trust_of_one_command
from s2c2a.runtime.emergency import EMERGENCY_STOP
from s2c2a.strategies import Recipe, TrainedNetworks, load_networks
from s2c2a.viz import Trace

from tools import small_networks
from xla_flags import known_flags

HASTY = (
    "--xla_cpu_use_fusion_emitters=false",
    "--xla_backend_optimization_level=0",
    "--xla_cpu_parallel_codegen_split_count=1",
)
"""Compiles in two thirds of the time; chains train as fast, networks of the paper's
kind by two fifths more slowly.

What users run is compiled with care, as in `make demo`. Each program is compiled in one
piece: the other core belongs to the other worker. Flags that a version of XLA does not
know are left out; jaxlib 0.12 does not know the first.
"""
MAX_MAPS = 8_000
"""Memory maps of a worker from which it forgets its programs: about 1.6 GB.

A compiled program takes three maps and half a megabyte with all that is known of it. The
programs of one file are seldom used by the next.
"""
MAX_BYTES = 2_000_000_000
NO_DIGEST = "0" * 64
FEW_EXAMPLES = 20
"""Of what Hypothesis draws for a law in `make test`; in `make test-all` it is 100."""
example_settings.register_profile("all", deadline=None)
example_settings.register_profile("few", max_examples=FEW_EXAMPLES, deadline=None)


def pytest_configure(config):
    """Keep compiled programs, and compile with little optimization: most time is that.

    Small ones, too: most are of single operations, and reading one takes a third of
    compiling it. JAX keeps them without its bound, which would look at all files for
    each new one; this process looks once. Processes that tests start use the same
    folder.
    """
    is_quick = config.option.markexpr == "not slow"
    example_settings.load_profile("few" if is_quick else "all")
    programs = config.rootpath / ".pytest_cache" / "programs"
    if not hasattr(config, "workerinput"):  # before any worker of xdist begins
        delete_large(programs)
        flags = known_flags(HASTY)
        # read when the first array is made; workers inherit them
        os.environ["XLA_FLAGS"] = " ".join([*flags, os.environ.get("XLA_FLAGS", "")])
    settings = {
        "jax_compilation_cache_dir": str(programs),
        "jax_compilation_cache_max_size": -1,
        "jax_persistent_cache_min_compile_time_secs": 0.0,
    }
    for name, value in settings.items():
        jax.config.update(name, value)
        os.environ[name.upper()] = str(value)
    # for workers of xdist and commands, which start with it: two threads of each of
    # them wait for each other on two cores
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def delete_large(programs: Path) -> None:
    """Delete the folder of compiled programs if it has grown beyond its bound."""
    if sum(file.stat().st_size for file in programs.glob("*")) > MAX_BYTES:
        rmtree(programs)


def pytest_collection_finish():
    """Keep what collection made out of the garbage collection: it stays to the end."""
    gc.freeze()


@pytest.fixture
def interruptible():
    """A process that handles interrupts, even as a background job of a shell."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def refusal(capsys):
    """Run a command that must fail with exit code 2; return its error message."""

    def run(*words: str) -> str:
        with pytest.raises(SystemExit) as stopped:
            main(words)
        assert stopped.value.code == 2
        return capsys.readouterr().err

    return run


@pytest.fixture(scope="module", autouse=True)
def _few_programs():
    """Drop compiled programs before they fill the memory."""
    yield
    if forget_programs(MAX_MAPS):
        gc.collect()
        return_memory()


def return_memory() -> None:
    """Give freed memory back to the system, which the allocator keeps otherwise."""
    with suppress(OSError, AttributeError):  # another system or C library
        ctypes.CDLL("libc.so.6").malloc_trim(0)


@pytest.fixture(autouse=True)
def _own_state():
    """Forget the custom code that a test trusts, and its emergency stop."""
    with trust_of_one_command():
        yield
    EMERGENCY_STOP.reset()


@pytest.fixture(scope="session")
def make_arm():
    """Build an arm of equal modules with evenly spaced cables; `module` changes all."""

    def make(
        modules: int = 3, cables: int = 3, module: dict | None = None, **changes
    ) -> ArmSpec:
        angles = tuple(360.0 * cable / cables for cable in range(cables))
        values = {
            "length": 0.2,
            "cable_radius": 0.027,
            "mass": 0.075,
            "bending_stiffness": 0.16,
        }
        kind = Module(**{**values, "cable_angles_deg": angles, **(module or {})})
        return ArmSpec(
            **{
                "name": "test_arm",
                "actuation": "displacement",
                "modules": (kind,) * modules,
                **changes,
            }
        )

    return make


@pytest.fixture
def drawn(make_arm):
    """Build a trace of an arm with given states; keywords are columns of its episode."""

    def build(label: str, times, states, counted=None, **columns) -> Trace:
        arm = make_arm(np.shape(states)[1])
        actions = np.zeros((len(states), arm.module_count, arm.cable_count))
        columns |= {"time": times, "actions": actions, "sensor.states": states}
        return Trace(Episode(arm, columns), label, counted)

    return build


@pytest.fixture(scope="session")
def twin() -> ArmSpec:
    """The preset driven by displacement."""
    return load_arm("twin_arm")


@pytest.fixture(scope="session")
def simulated() -> ArmSpec:
    """The preset driven by tension."""
    return load_arm("simulated_arm")


@pytest.fixture(scope="session")
def recording() -> Recording:
    """Six short episodes of the twin."""
    return load_recording(small_networks.RECORDING)


@pytest.fixture(scope="session")
def tiny_recipe() -> Recipe:
    """The paper's recipe with far smaller networks and a few quick epochs."""
    return small_networks.PAPER_RECIPE


@pytest.fixture(scope="session")
def tiny_best_recipe() -> Recipe:
    """The recipe `best`, as small and as quick."""
    return small_networks.BEST_RECIPE


@pytest.fixture(scope="session")
def strategy_file() -> Path:
    """A saved strategy for the twin."""
    return small_networks.PAPER


@pytest.fixture(scope="session")
def best_strategy_file() -> Path:
    """A saved strategy of the recipe `best` for the twin."""
    return small_networks.BEST


@pytest.fixture(scope="session")
def tiny_networks(strategy_file) -> TrainedNetworks:
    """Really trained, on the small recording, a little."""
    return load_networks(strategy_file)


@pytest.fixture(scope="session")
def tiny_best_networks(best_strategy_file) -> TrainedNetworks:
    """Trained by the recipe `best` on the small recording, a little."""
    return load_networks(best_strategy_file)


@pytest.fixture
def forged(tmp_path):
    """Change a file of trained networks by a function and give it a valid digest."""

    def write_anew(path: Path, change) -> Path:
        with safe_open(path, framework="numpy") as file:
            metadata, arrays = json.loads(file.metadata()["s2c2a"]), load_file(path)
        change(metadata, arrays)
        beside = {"s2c2a": json.dumps(metadata), "digest": NO_DIGEST}
        content = save(arrays, metadata=beside)
        digest = blake2b(content, digest_size=32).hexdigest()
        (tmp_path / "forged.safetensors").write_bytes(
            content.replace(NO_DIGEST.encode(), digest.encode(), 1)
        )
        return tmp_path / "forged.safetensors"

    return write_anew
