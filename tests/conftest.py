"""What many tests share: arms, a small recording, small networks."""

import gc
import json
import os
from dataclasses import replace
from hashlib import blake2b
from pathlib import Path

import jax
import numpy as np
import pytest
from safetensors import safe_open
from safetensors.numpy import load_file, save

from s2c2a.arm import ArmSpec, Module, load_arm
from s2c2a.cache import delete_incomplete_programs
from s2c2a.control.options import C2AOptions
from s2c2a.data import CollectOptions, Recording, collect
from s2c2a.episodes import Episode
from s2c2a.executors import forget_programs
from s2c2a.models import C2SOptions, ChainOptions
from s2c2a.plugins import trust_of_one_command
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.strategies import (
    Recipe,
    TrainedNetworks,
    recipe_named,
    save_strategy,
    train_s2c2a,
)
from s2c2a.training import FitOptions
from s2c2a.viz import Trace

from xla_flags import known_flags

LONGEST = (
    "test_pipeline",
    "test_artifacts",
    "test_cluster",
    "test_examples_run",
    "test_live_page_in_browser",
    "test_local",
)
"""Files that go first, so that no worker is left with one of them when all others have
ended."""
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
EPISODES, SAMPLES = 6, 100
# of memory; the system allows 65,530 to a process, and a compiled program takes a few
MAX_MAPS = 30_000
NO_DIGEST = "0" * 64
TINY, QUICK = (
    C2AOptions(layers=1, hidden=8),
    FitOptions(learning_rate=1e-2, max_epochs=12, epochs_per_call=6),
)


def pytest_configure(config):
    """Cache compiled programs, and compile with little optimization: most time is that.

    Processes that tests start keep theirs in the same folder, under the same bound:
    with the bound comes a lock, and who writes without it leaves what the others take
    for half a program.
    """
    programs = config.rootpath / ".pytest_cache" / "programs"
    if not hasattr(config, "workerinput"):  # before any worker of xdist begins
        delete_incomplete_programs(programs)
        flags = known_flags(HASTY)
        # read when the first array is made; workers inherit them
        os.environ["XLA_FLAGS"] = " ".join([*flags, os.environ.get("XLA_FLAGS", "")])
    settings = {
        "jax_compilation_cache_dir": str(programs),
        "jax_compilation_cache_max_size": 2_000_000_000,
        "jax_persistent_cache_min_compile_time_secs": 0.1,
    }
    for name, value in settings.items():
        jax.config.update(name, value)
        os.environ[name.upper()] = str(value)
    # for workers of xdist and commands, which start with it: two threads of each of
    # them wait for each other on two cores
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def pytest_collection_modifyitems(items):
    """Long files first."""
    place = {name: number for number, name in enumerate(LONGEST)}
    items.sort(key=lambda item: place.get(item.path.stem, len(place)))


@pytest.fixture(scope="module", autouse=True)
def _few_programs():
    """Drop compiled programs before the system's limit of memory maps is reached."""
    yield
    forget_programs(MAX_MAPS)
    gc.collect()


@pytest.fixture(autouse=True)
def _own_trust():
    """Forget the custom code that a test trusts."""
    with trust_of_one_command():
        yield


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
def recording(twin, tmp_path_factory) -> Recording:
    """Six short episodes of the twin."""
    path = tmp_path_factory.mktemp("shared") / "twin.episodes"
    options = CollectOptions(episodes=EPISODES, samples=SAMPLES)
    return collect(
        path,
        twin,
        lambda seed: SimulatedRobot(twin, seed=seed),
        options,
        robot="simulation fast",
    )


@pytest.fixture(scope="session")
def tiny_recipe() -> Recipe:
    """The paper's recipe with far smaller networks and a few quick epochs."""
    return replace(
        recipe_named("paper"),
        name="tiny",
        c2s=C2SOptions(1, 8),
        c2a=TINY,
        c2s_fit=QUICK,
        c2a_fit=QUICK,
    )


@pytest.fixture(scope="session")
def tiny_best_recipe() -> Recipe:
    """The recipe `best`, as small and as quick."""
    size, fit = (
        ChainOptions(hidden=8, depth=1, play_widths=(0.005, 0.02), creep_times=(1.0,)),
        replace(QUICK, decay=True),
    )
    return replace(
        recipe_named("best"),
        name="tiny_best",
        c2s=size,
        c2a=TINY,
        c2s_fit=fit,
        c2a_fit=fit,
    )


@pytest.fixture(scope="session")
def tiny_networks(recording, tiny_recipe) -> TrainedNetworks:
    """Really trained, on the small recording, a little."""
    return train_s2c2a(recording, tiny_recipe, seed=7)


@pytest.fixture(scope="session")
def tiny_best_networks(recording, tiny_best_recipe) -> TrainedNetworks:
    """Trained by the recipe `best` on the small recording, a little."""
    return train_s2c2a(recording, tiny_best_recipe, seed=7)


@pytest.fixture(scope="session")
def best_strategy_file(tiny_best_networks, tmp_path_factory) -> Path:
    """A saved strategy of the recipe `best` for the twin."""
    path = tmp_path_factory.mktemp("shared") / "twin_best.safetensors"
    save_strategy(tiny_best_networks, path)
    return path


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


@pytest.fixture(scope="session")
def strategy_file(tiny_networks, tmp_path_factory) -> Path:
    """A saved strategy for the twin."""
    path = tmp_path_factory.mktemp("shared") / "twin.safetensors"
    save_strategy(tiny_networks, path)
    return path
