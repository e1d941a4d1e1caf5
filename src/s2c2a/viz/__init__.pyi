from .arm_drawing import arm_figure
from .coverage import coverage_figure, coverage_image
from .figures import learning_curves, recording_figure, run_figure, trials_figure
from .measured_ends import measured_ends_figure
from .replay import replay_page
from .trace import Trace

__all__ = [
    "Trace",
    "arm_figure",
    "coverage_figure",
    "coverage_image",
    "learning_curves",
    "measured_ends_figure",
    "recording_figure",
    "replay_page",
    "run_figure",
    "trials_figure",
]
