"""Shipped networks of both arms, trained ones of the paper's recipe, and synthetic runs."""

from dataclasses import replace

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.jobs import Cache, RecordingArtifact, made
from s2c2a.jobs.circle import ARMS
from s2c2a.kinematics import states_from_bends
from s2c2a.strategies import recipe_named, shipped_networks, train_s2c2a
from s2c2a.training import FitOptions
from s2c2a.viz import Trace

SHORT = FitOptions(max_epochs=25, patience=25)


@pytest.fixture(scope="session")
def cache(tmp_path_factory):
    return Cache(tmp_path_factory.mktemp("cache"))


@pytest.fixture(scope="session")
def trained():
    """Shipped networks of both arms by the recipe `best`: name -> TrainedNetworks."""
    return {name: shipped_networks(load_arm(name)) for name in ARMS}


@pytest.fixture(scope="session")
def trained_as_the_paper(cache):
    """Networks of the twin by the recipe `paper` with fewer epochs."""
    recipe = replace(recipe_named("paper"), c2s_fit=SHORT, c2a_fit=SHORT)
    twin = load_arm("twin_arm")
    recording = made(RecordingArtifact(twin, recipe.collect_options()), cache)
    return train_s2c2a(recording, recipe, seed=0)


@pytest.fixture(scope="session")
def asked():
    """Jobs that a study asks for, instead of making them."""

    class RequestedError(Exception):
        pass

    def make(jobs):
        raise RequestedError(jobs)

    def ask(rows_of_study, study) -> list:
        with pytest.raises(RequestedError) as requested:
            rows_of_study(study, make)
        return requested.value.args[0]

    return ask


@pytest.fixture
def make_trace(drawn):
    """Make runs around a circle, `lag` [rad] behind the target of the last module."""

    def make(
        label: str = "s2c2a", lag: float = 0.0, modules: int = 3, **changes
    ) -> Trace:
        around = 2 * np.pi * np.arange(200) / 200
        desired, states = (_states_round(around - late, modules) for late in (0.0, lag))
        positions, axes = np.full((2, 200, modules, 3), np.nan)
        positions[:, -1], axes[:, -1] = desired[:, -1, :3], desired[:, -1, 3:]
        values = {
            "times": 0.1 * np.arange(200),
            "states": states,
            "desired_positions": positions,
            "desired_axes": axes,
        }
        obstacles = np.tile([[0.16, 0.14, 0.30, 0.05]], (200, 1, 1))
        return drawn(label, **{**values, "obstacles": obstacles, **changes})

    return make


def _states_round(angles: np.ndarray, modules: int) -> np.ndarray:
    bend = 0.78 / modules * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    bends = np.repeat(bend[:, None], modules, axis=1)
    return np.asarray(
        states_from_bends(bends, np.full(modules, 0.6 / modules)), dtype=float
    )


@pytest.fixture
def traces(make_trace) -> list[Trace]:
    """Three strategies on one task."""
    return [
        make_trace(),
        make_trace("pcc", lag=0.15),
        make_trace("pcc-fitted", lag=0.08),
    ]
