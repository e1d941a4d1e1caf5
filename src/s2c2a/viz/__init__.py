"""Figures and replay pages, from State values alone: simulation, real arm and recordings are drawn alike.

A `Trace` is what is drawn. `replay_page` writes a page to watch it on, `run_figure` a figure of it, `arm_figure` a
drawing of the arm itself; the others answer figures of the paper. Matplotlib is imported when the first figure is asked
for, not before.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from s2c2a.viz.replay import replay_page
from s2c2a.viz.shape import centre_line
from s2c2a.viz.trace import Trace

if TYPE_CHECKING:
    from s2c2a.viz.arm_drawing import arm_figure
    from s2c2a.viz.figures import learning_curves, recording_figure, run_figure
    from s2c2a.viz.paper_figures import comparison_bars, coordinates_figure, estimation_figure, orientation_figure
    from s2c2a.viz.paper_obstacles import interaction_figure, obstacles_figure
    from s2c2a.viz.paper_views import plan_view_figure, poses_figure
    from s2c2a.viz.trials import trials_figure

__all__ = [
    "Trace",
    "arm_figure",
    "centre_line",
    "comparison_bars",
    "coordinates_figure",
    "estimation_figure",
    "interaction_figure",
    "learning_curves",
    "obstacles_figure",
    "orientation_figure",
    "plan_view_figure",
    "poses_figure",
    "recording_figure",
    "replay_page",
    "run_figure",
    "trials_figure",
]

_NEED_MATPLOTLIB = {
    "arm_figure": "s2c2a.viz.arm_drawing",
    "comparison_bars": "s2c2a.viz.paper_figures",
    "coordinates_figure": "s2c2a.viz.paper_figures",
    "estimation_figure": "s2c2a.viz.paper_figures",
    "interaction_figure": "s2c2a.viz.paper_obstacles",
    "learning_curves": "s2c2a.viz.figures",
    "obstacles_figure": "s2c2a.viz.paper_obstacles",
    "orientation_figure": "s2c2a.viz.paper_figures",
    "plan_view_figure": "s2c2a.viz.paper_views",
    "poses_figure": "s2c2a.viz.paper_views",
    "recording_figure": "s2c2a.viz.figures",
    "run_figure": "s2c2a.viz.figures",
    "trials_figure": "s2c2a.viz.trials",
}


def __getattr__(name: str):
    """Import the functions that need matplotlib when they are first used."""
    if name not in _NEED_MATPLOTLIB:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(import_module(_NEED_MATPLOTLIB[name]), name)
