"""What a strategy believes of its arm beside where it is, in words; nothing where it senses no more than its motors."""

from collections.abc import Mapping

import numpy as np

from s2c2a.episodes import Episode

LEFT_OUT = "left_out."


def belief_said(told: Mapping[str, np.ndarray]) -> str:
    """Load, the largest lean, and senses that are left out.

    Args:
        told: what the strategy made of a step, by column of an episode: `load` [kg],
            `leans` [rad], `push` [N], `left_out.NAME`.
    """
    senses = {
        name.removeprefix(LEFT_OUT): value
        for name, value in told.items()
        if name.startswith(LEFT_OUT)
    }
    if not senses:
        return ""
    grams = 1000.0 * float(told["load"])
    leans = np.rad2deg(np.linalg.norm(told["leans"], axis=-1))
    said = f"at the tip: {grams:.0f} g · leans: {leans.max():.1f} deg, as if pushed by {float(told['push']):.1f} N"
    wrong = [name for name, value in senses.items() if value > 0]
    return f"{said} · **not believed: {', '.join(wrong)}**" if wrong else said


def said_of_belief(episode: Episode) -> str:
    """What was heard in a run beside encoders, what was found by it, and what was not believed for how long."""
    heard = [
        name.removeprefix(LEFT_OUT)
        for name in episode.columns
        if name.startswith(LEFT_OUT)
    ]
    if not heard or not len(episode.running):
        return ""
    leans = np.rad2deg(np.linalg.norm(episode.ran("leans"), axis=-1).max())
    left_out = {name: int((episode.ran(LEFT_OUT + name) > 0).sum()) for name in heard}
    grams = 1000 * episode.ran("load")[-1]
    found = f"heard {', '.join(heard)}; found {grams:.0f} g at the tip, leans to {leans:.1f} deg"
    wrong = "".join(
        f"; {name} was not believed in {count} steps"
        for name, count in left_out.items()
        if count
    )
    return found + wrong
