"""Drawing of arms and runs: figures, replay pages and videos, from `States` alone.

Simulated, real and recorded arms look alike. A `Trace` is a run to draw. `replay_page`
writes an interactive page, `run_figure` a figure of runs, `arm_figure` a drawing of an
arm. Matplotlib is imported on first use.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from s2c2a.viz.mesh import center_line
from s2c2a.viz.replay import replay_page
from s2c2a.viz.trace import Trace

if TYPE_CHECKING:  # what the table below imports, for type checkers and documentation
    from s2c2a.viz.arm_drawing import arm_figure
    from s2c2a.viz.coverage import coverage_figure, coverage_image
    from s2c2a.viz.figures import (
        learning_curves,
        recording_figure,
        run_figure,
        trials_figure,
    )
    from s2c2a.viz.measured_ends import measured_ends_figure

_MATPLOTLIB_MODULES = {
    "arm_figure": "arm_drawing",
    "coverage_figure": "coverage",
    "coverage_image": "coverage",
    "learning_curves": "figures",
    "measured_ends_figure": "measured_ends",
    "recording_figure": "figures",
    "run_figure": "figures",
    "trials_figure": "figures",
}


def __getattr__(name: str):
    """Import functions that need matplotlib on first use."""
    if name not in _MATPLOTLIB_MODULES:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(import_module(f"{__name__}.{_MATPLOTLIB_MODULES[name]}"), name)
