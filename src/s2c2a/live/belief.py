"""What a strategy believes of its arm beside where it is, in words; nothing where it senses no more than its motors."""

from collections.abc import Mapping

import numpy as np

LEFT_OUT = "left_out."


def belief_said(told: Mapping[str, np.ndarray]) -> str:
    """Load, the largest lean, and senses that are left out.

    Args:
        told: what the strategy made of a step, by column of an episode: `load` [kg], `leans` [rad], `push` [N],
            `left_out.NAME`.
    """
    senses = {name.removeprefix(LEFT_OUT): value for name, value in told.items() if name.startswith(LEFT_OUT)}
    if not senses:
        return ""
    grams, leans = 1000.0 * float(told["load"]), np.rad2deg(np.linalg.norm(told["leans"], axis=-1))
    said = f"at the tip: {grams:.0f} g · leans: {leans.max():.1f} deg, as if pushed by {float(told['push']):.1f} N"
    wrong = [name for name, value in senses.items() if value > 0]
    return f"{said} · **not believed: {', '.join(wrong)}**" if wrong else said


def margins_said(margins: str) -> str:
    """Those of the loop, for a panel."""
    return f"Margins of the loop: {margins}." if margins else ""
