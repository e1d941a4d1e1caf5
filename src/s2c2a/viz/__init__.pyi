from .arm_drawing import arm_figure
from .coverage import coverage_figure, coverage_image
from .figures import learning_curves, recording_figure, run_figure
from .reach import reach_figure
from .replay import replay_page
from .trace import Trace

__all__ = [
    "Trace",
    "arm_figure",
    "coverage_figure",
    "coverage_image",
    "learning_curves",
    "reach_figure",
    "recording_figure",
    "replay_page",
    "run_figure",
]
