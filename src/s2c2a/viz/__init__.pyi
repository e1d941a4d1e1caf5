from .arm_drawing import arm_figure
from .coverage import coverage_figure, coverage_image
from .figures import learning_curves, recording_figure, run_figure
from .mesh import center_line
from .replay import replay_page
from .trace import Trace

__all__ = [
    "Trace",
    "arm_figure",
    "center_line",
    "coverage_figure",
    "coverage_image",
    "learning_curves",
    "recording_figure",
    "replay_page",
    "run_figure",
]
