"""Figures and replay pages, from State values alone: simulation, real arm and recordings are drawn alike.

A `Trace` is what is drawn. `replay_page` writes a page to watch it on, `run_figure` a
figure of it, `arm_figure` a drawing of the arm itself. Matplotlib is imported when the
first figure is asked for, not before.
"""

from importlib import import_module

from s2c2a.viz.mesh import center_line
from s2c2a.viz.replay import replay_page
from s2c2a.viz.trace import Trace

_NEED_MATPLOTLIB = {"arm_figure": "arm_drawing"} | dict.fromkeys(
    ("learning_curves", "recording_figure", "run_figure", "trials_figure"), "figures"
)


def __getattr__(name: str):
    """Import the functions that need matplotlib when they are first used."""
    if name not in _NEED_MATPLOTLIB:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(import_module(f"{__name__}.{_NEED_MATPLOTLIB[name]}"), name)
