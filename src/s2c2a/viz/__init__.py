"""Drawing of arms and runs: figures and replay pages, from `States` alone.

Simulated, real and recorded arms look alike. A `Trace` is a run to draw. `replay_page`
writes an interactive page, `run_figure` a figure of runs, `arm_figure` a drawing of an
arm. Matplotlib is imported on first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
