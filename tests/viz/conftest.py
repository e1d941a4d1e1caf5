"""Synthetic runs: an arm of constant curvature whose tip follows a circle."""

import numpy as np
import pytest

from s2c2a.arm import ArmSpec
from s2c2a.viz import Trace

RADIUS = 0.22  # m
HEIGHT = 0.54  # m
STEPS = 200
BEND = 0.26  # rad


def _bent_states(bend: float, directions: np.ndarray, modules: int) -> np.ndarray:
    """States (time, modules, 6) of an arm of 0.6 m whose modules bend by `bend`."""
    angles = bend * np.arange(1, modules + 1)
    radius = 0.6 / modules / bend
    sideways = np.stack([radius * (1 - np.cos(angles)), np.sin(angles)], axis=-1)
    upward = np.stack([radius * np.sin(angles), np.cos(angles)], axis=-1)
    plane = np.stack([np.cos(directions), np.sin(directions)], axis=-1)
    # (time, modules, position and axis, 2)
    flat = np.einsum("td,mk->tmkd", plane, sideways)
    rise = np.broadcast_to(upward[None, :, :, None], (*flat.shape[:3], 1))
    return np.concatenate([flat, rise], axis=-1).reshape(directions.size, modules, 6)


@pytest.fixture(scope="session")
def make_arm(make_arm):
    """Build an arm of 0.6 m of equal modules."""

    def make(modules: int = 3, cables: int = 3, **changes) -> ArmSpec:
        return make_arm(modules, cables, {"length": 0.6 / modules}, **changes)

    return make


@pytest.fixture
def make_trace(drawn):
    """Build a run around a circle, `lag` [rad] behind the last module's target."""

    def make(
        label: str = "s2c2a",
        bend: float = BEND,
        lag: float = 0.0,
        modules: int = 3,
        **changes,
    ) -> Trace:
        around = 2 * np.pi * np.arange(STEPS) / STEPS
        wobble = bend * (1 + 0.04 * np.sin(7 * around + 9 * bend))
        states = np.concatenate(
            [
                _bent_states(b, a, modules)
                for b, a in zip(wobble, around[:, None] - lag, strict=True)
            ]
        )
        x = RADIUS * np.cos(around)
        y = RADIUS * np.sin(around)
        positions = np.full((STEPS, modules, 3), np.nan)
        positions[:, -1] = np.stack([x, y, np.full(STEPS, HEIGHT)], axis=-1)
        axes = np.full((STEPS, modules, 3), np.nan)
        axes[:, -1] = _bent_states(BEND, around, modules)[:, -1, 3:]
        values = {
            "times": 0.1 * np.arange(STEPS),
            "states": states,
            "desired_positions": positions,
            "desired_axes": axes,
        }
        obstacles = np.tile([[0.16, 0.14, 0.30, 0.05]], (STEPS, 1, 1))
        return drawn(label, **{**values, "obstacles": obstacles, **changes})

    return make


@pytest.fixture
def drawn_figures(monkeypatch):
    """Figures that are drawn instead of written."""
    figures = []
    for module in ("arm_drawing", "coverage", "figures"):
        monkeypatch.setattr(
            f"s2c2a.viz.{module}.save_figure",
            lambda figure, path, **_: figures.append(figure),
        )
    return figures


@pytest.fixture(
    params=[
        ((0, 0, -1), (0, 1)),
        ((0, 0, 0), (0, 1)),
        ((0, 0, 1), (0, -1)),
        ((1, 0, 0), (1, 0)),
        ((0, 0.8, -0.6), (1, 0)),
        ((0, -0.8, 0.6), (1, 0)),
    ]
)
def mount(request):
    """A direction of gravity, and that of the straight arm in drawings of its side."""
    return request.param


@pytest.fixture
def straight() -> np.ndarray:
    """States (modules, 6) of the straight arm."""
    states = np.zeros((3, 6))
    states[:, 2] = (0.2, 0.4, 0.6)
    states[:, 5] = 1.0
    return states


@pytest.fixture
def arm(make_arm) -> ArmSpec:
    """Three modules of three cables."""
    return make_arm()


@pytest.fixture
def traces(make_trace) -> list[Trace]:
    """Three controllers on one task."""
    return [
        make_trace(),
        make_trace("pcc", bend=0.30, lag=0.15),
        make_trace("pcc-fitted", bend=0.25, lag=0.08),
    ]
