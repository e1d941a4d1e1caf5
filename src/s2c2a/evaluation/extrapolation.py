"""Steps of a run whose plan lies outside the training data of the forward model."""

import numpy as np
from jaxtyping import Bool, Float

from s2c2a.episodes import Episode
from s2c2a.spaces import POSITION

TOLERATED = 0.1  # of the steps; a model is outside at the border of its data, too


def is_outside_data(
    predictive_std: Float[np.ndarray, "*batch modules"],
    extrapolation: Float[np.ndarray, "*batch"],
) -> Bool[np.ndarray, "*batch"]:
    """Whether extrapolation is the larger part of the tip's predictive variance.

    The part near the data is sqrt(s^2 - e^2), with the tip's standard deviation s and
    its part e from extrapolation; outside the data, e is larger.

    Args:
        predictive_std: standard deviation of the predicted module ends [m].
        extrapolation: the part of the tip's that is due to missing data [m].

    Returns:
        False where a model has no uncertainty (zero or NaN).
    """
    variance = np.square(predictive_std[..., -1])
    return 2.0 * np.square(extrapolation) > variance


def describe_extrapolation(episode: Episode) -> str:
    """Describe where the plans of a run lie outside the training data.

    Returns:
        Number of these steps, with time and place of the first stretch; empty if they
        are at most a tenth of the steps, or if the model has no uncertainty.
    """
    if not {"predictive_std", "extrapolation"} <= episode.columns.keys():
        return ""
    outside = is_outside_data(
        episode.ran("predictive_std"), episode.ran("extrapolation")
    )
    if outside.sum() <= TOLERATED * len(outside):
        return ""
    begin = int(np.argmax(outside))
    # until the first step that is inside again, or the end
    count = int(np.argmin(np.append(outside[begin:], False)))
    times = episode.times()
    first = f"from {times[begin]:.1f} to {times[begin + count - 1]:.1f} s"
    if "predicted" in episode.columns:
        tip = 100.0 * episode.ran("predicted")[begin + count // 2, -1, POSITION]
        place = ", ".join(f"{coordinate:.0f}" for coordinate in tip)
        first += f" near ({place}) cm"
    return (
        f"the path lies outside the training data in {outside.sum()} of "
        f"{len(outside)} steps, first {first}; record more "
        "episodes, or choose a smaller path (a slower pace does not help)"
    )
