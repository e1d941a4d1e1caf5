"""Figures and replay pages, from State values alone: simulation, real arm and recordings are drawn alike.

A `Trace` is what is drawn. `replay_page` writes a page to watch it on, `run_figure` a figure of it, `arm_figure` a
drawing of the arm itself. Matplotlib is imported when the first figure is asked for, not before.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from s2c2a.viz.replay import replay_page
from s2c2a.viz.shape import centre_line
from s2c2a.viz.trace import Trace

if TYPE_CHECKING:
    from s2c2a.viz.arm_drawing import arm_figure
    from s2c2a.viz.figures import learning_curves, recording_figure, run_figure
    from s2c2a.viz.trials import trials_figure

__all__ = [
    "Trace",
    "arm_figure",
    "centre_line",
    "learning_curves",
    "recording_figure",
    "replay_page",
    "run_figure",
    "trials_figure",
]

_NEED_MATPLOTLIB = {
    "arm_figure": "s2c2a.viz.arm_drawing",
    "learning_curves": "s2c2a.viz.figures",
    "recording_figure": "s2c2a.viz.figures",
    "run_figure": "s2c2a.viz.figures",
    "trials_figure": "s2c2a.viz.trials",
}


def __getattr__(name: str):
    """Import the functions that need matplotlib when they are first used."""
    if name not in _NEED_MATPLOTLIB:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(import_module(_NEED_MATPLOTLIB[name]), name)
