"""From an episode to what is drawn of it."""

import numpy as np

from s2c2a.episodes import Episode
from s2c2a.errors import S2C2AError
from s2c2a.viz.trace import Trace


def trace_of(episode: Episode, label: str | None = None, counted: np.ndarray | None = None) -> Trace:
    """What is drawn of an episode's run: where the arm was after each action, and what was asked then.

    Args:
        episode: with true states.
        label: for legends; its strategy's name if not stated.
        counted: which steps count in the mean error; all if not stated.

    Raises:
        S2C2AError: it holds no true states.
    """
    if "states" not in episode.sensors:
        raise S2C2AError("this episode holds no true states, so there is nothing to draw")
    whole = len(episode.running) and episode.running[-1] + 1 >= len(episode)  # nothing was read after the last action
    states = episode.sensor("states")[episode.running] if whole else episode.after("states")
    times = episode.ran("time") if whole else episode.times()
    steps, modules = states.shape[:2]
    nothing = np.full((steps, modules, 3), np.nan)
    wanted, axes = (
        nothing if episode.get(name) is None else episode.ran(name) for name in ("wanted_positions", "wanted_axes")
    )
    spheres = np.zeros((steps, 0, 4)) if episode.get("obstacles") is None else episode.ran("obstacles")
    return Trace(label or str(episode.options.get("strategy", "")), times, states, wanted, axes, spheres, counted)
