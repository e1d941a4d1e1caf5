"""What many tests share: arms, a small recording, small networks."""

from dataclasses import replace

import jax
import numpy as np
import pytest

from s2c2a.arm import ArmSpec, Module, load_arm
from s2c2a.data import CollectOptions, Recording, collect
from s2c2a.networks import C2A, C2S, Scaling
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.strategies import TrainedNetworks, recipe_named, save_strategy, train_s2c2a
from s2c2a.training import FitOptions
from s2c2a.training.networks import NetworkSize, state_scaling

EPISODES, SAMPLES = 6, 100


def pytest_configure(config):
    """Keep what JAX compiles from test to test and run to run; compiling is most of the tests' time."""
    jax.config.update("jax_compilation_cache_dir", str(config.rootpath / ".pytest_cache" / "jax"))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.1)


@pytest.fixture(scope="session")
def make_arm():
    """Builds a displacement arm of equal, evenly cabled modules of 0.2 m; `module` changes all of them."""

    def make(modules: int = 3, cables: int = 3, module: dict | None = None, **changes) -> ArmSpec:
        angles = tuple(360.0 * cable / cables for cable in range(cables))
        values = {"length": 0.2, "cable_radius": 0.027, "mass": 0.075, "bending_stiffness": 0.16}
        kind = Module(**{**values, "cable_angles_deg": angles, **(module or {})})
        return ArmSpec(**{"name": "test_arm", "actuation": "displacement", "modules": (kind,) * modules, **changes})

    return make


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
    path = tmp_path_factory.mktemp("shared") / "twin.h5"
    options = CollectOptions(episodes=EPISODES, samples=SAMPLES)
    return collect(path, twin, lambda seed: SimulatedRobot(twin, seed=seed), options, body="simulation fast")


@pytest.fixture(scope="session")
def tiny_recipe():
    """The paper's recipe with far smaller networks and a few quick epochs; its files cannot be loaded back."""
    size, options = NetworkSize(layers=1, hidden=8), FitOptions(learning_rate=1e-2, most_epochs=12, epochs_per_call=6)
    return replace(recipe_named("paper"), c2s=size, c2a=size, c2s_fit=options, c2a_fit=options)


@pytest.fixture(scope="session")
def tiny_networks(recording, tiny_recipe) -> TrainedNetworks:
    """Really trained, on the small recording, a little."""
    return train_s2c2a(recording, tiny_recipe, seed=0)


@pytest.fixture(scope="session")
def paper_networks(recording) -> TrainedNetworks:
    """Networks of the paper's sizes, scaled to the small recording but with random weights: quick, and can be saved."""
    arm, recipe, key = recording.arm, recipe_named("paper"), jax.random.key(0)
    c2s = C2S.untrained(recipe.c2s.layers, recipe.c2s.hidden, key)
    c2a = C2A.untrained(arm, recipe.c2a.layers, recipe.c2a.hidden, key)
    scaling = Scaling.of(recording.configurations.astype(np.float32))
    percent = {"C2S": (2.5, 1.25), "C2A": (3.5, 1.75)}
    curves = {name: np.array([[1.0, 0.5, 0.25]]) for name in percent}
    return TrainedNetworks(
        arm,
        recipe.name,
        seed=7,
        c2s=C2S(c2s.network, scaling, state_scaling(recording.states)),
        c2a=C2A(c2a.network, scaling, c2a.sum_and_range),
        percent=percent,
        curves=curves,
    )


@pytest.fixture(scope="session")
def strategy_file(paper_networks, tmp_path_factory):
    """A saved strategy for the twin."""
    path = tmp_path_factory.mktemp("shared") / "twin.safetensors"
    save_strategy(paper_networks, path)
    return path
