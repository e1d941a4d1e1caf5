"""Descriptions of estimates: payload, bend bias, force, and rejected sensors.

Empty for strategies without an estimator, which have no `rejected.*` columns.
"""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from s2c2a.arm.spec import HEAVIEST
from s2c2a.episodes import Episode

REJECTED = "rejected."


def describe_step_estimates(diagnostics: Mapping[str, np.ndarray]) -> str:
    """Describe the estimates of one control step.

    Args:
        diagnostics: telemetry of a step, by column of an episode: `payload` [kg],
            `bend_biases` [rad], `external_force` [N], and `rejected.NAME`, which is
            positive while the sensor is rejected.
    """
    sensors = _estimator_sensors(diagnostics)
    if not sensors:
        return ""
    text = _describe(
        float(diagnostics["payload"]),
        diagnostics["bend_biases"],
        float(diagnostics["external_force"]),
    )
    rejected = [name for name in sensors if diagnostics[REJECTED + name] > 0]
    if rejected:
        text += f"; **rejected: {', '.join(rejected)}**"
    return text


def describe_estimates(episode: Episode) -> str:
    """Describe the estimates of a run.

    The payload is that of the last step, bend bias and external force are the largest
    of the run; rejected sensors follow with their share of the steps.
    """
    sensors = _estimator_sensors(episode.columns)
    if not sensors or not len(episode.running):
        return ""
    text = _describe(
        episode.ran("payload")[-1],
        episode.ran("bend_biases"),
        np.nanmax(episode.ran("external_force")),
    )
    # the filter has single precision
    if episode.ran("payload")[-1] >= np.float32(HEAVIEST * episode.arm.mass):
        text = text.replace("payload", "payload at least", 1)
    rejected = []
    for name in sensors:
        share = np.mean(episode.ran(REJECTED + name) > 0)
        if share > 0:
            rejected.append(f"{name} {100 * share:.3g} % of the steps")
    if rejected:
        text += f"; rejected: {', '.join(rejected)}"
    return text


def _estimator_sensors(columns: Mapping[str, np.ndarray]) -> list[str]:
    """Names of the sensors that the estimator uses."""
    names = [name for name in columns if name.startswith(REJECTED)]
    return [name.removeprefix(REJECTED) for name in names]


def _describe(
    payload: float, bend_biases: Float[np.ndarray, "*batch modules 2"], force: float
) -> str:
    if not (payload or np.any(bend_biases)):
        return "no payload or bend bias is estimated"
    biases_deg = np.rad2deg(np.linalg.norm(bend_biases, axis=-1))
    return (
        f"payload {1000 * payload:.0f} g, "
        f"largest bend bias {np.nanmax(biases_deg):.1f} deg "
        f"(external force {force:.1f} N)"
    )
