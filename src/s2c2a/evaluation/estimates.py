"""What a strategy believes of its arm beside where it is, in words; nothing where it sensors no more than its motors."""

from collections.abc import Mapping

import numpy as np

from s2c2a.episodes import Episode

REJECTED = "rejected."


def belief_said(told: Mapping[str, np.ndarray]) -> str:
    """Load, the largest lean, and sensors that are left out.

    Args:
        told: what the strategy made of a step, by column of an episode: `load` [kg],
            `bend_biases` [rad], `external_force` [N], `rejected.NAME`.
    """
    sensors = {
        name.removeprefix(REJECTED): value
        for name, value in told.items()
        if name.startswith(REJECTED)
    }
    if not sensors:
        return ""
    grams = 1000.0 * float(told["load"])
    leans = np.rad2deg(np.linalg.norm(told["bend_biases"], axis=-1))
    said = f"at the tip: {grams:.0f} g · leans: {leans.max():.1f} deg, as if pushed by {float(told['push']):.1f} N"
    wrong = [name for name, value in sensors.items() if value > 0]
    return f"{said} · **not believed: {', '.join(wrong)}**" if wrong else said


def said_of_belief(episode: Episode) -> str:
    """What was heard in a run beside encoders, what was found by it, and what was not believed for how long."""
    heard = [
        name.removeprefix(REJECTED)
        for name in episode.columns
        if name.startswith(REJECTED)
    ]
    if not heard or not len(episode.running):
        return ""
    leans = np.rad2deg(np.linalg.norm(episode.ran("bend_biases"), axis=-1).max())
    rejected = {name: int((episode.ran(REJECTED + name) > 0).sum()) for name in heard}
    grams = 1000 * episode.ran("load")[-1]
    found = f"heard {', '.join(heard)}; found {grams:.0f} g at the tip, leans to {leans:.1f} deg"
    wrong = "".join(
        f"; {name} was not believed in {count} steps"
        for name, count in rejected.items()
        if count
    )
    return found + wrong
