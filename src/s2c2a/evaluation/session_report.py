"""What a session shows: how far an arm is from its model, and why."""

from collections.abc import Iterable
from itertools import chain

import numpy as np
from jaxtyping import Float
from scipy.interpolate import make_interp_spline
from scipy.special import chdtri

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.episodes import Episode
from s2c2a.evaluation.extrapolation import is_outside_data
from s2c2a.evaluation.lasting_error import module_ends
from s2c2a.models.session_fit import (
    DayPosterior,
    SessionFit,
    samples_per_independent_one,
)
from s2c2a.planning import SIGNIFICANT
from s2c2a.runtime import StepRecord, build_episode
from s2c2a.spaces import POSITION

COMPARED = {"predicted", "predictive_std", "extrapolation", "sensed", "planned"}
SEEN = "states", "camera_positions"
"""Sensors of the module ends, the best first."""
UNLIKELY = 0.05  # the usual level of a test: so often no change looks like one
WATCHED = 30.0  # s, of a stretch; errors of soft arms correlate over a few seconds


def describe_session(fit: SessionFit, arm: ArmSpec) -> list[str]:
    """Describe the error, what runs use, and every cause with its size, in sentences.

    Causes that are distinguishable from none only together are said together.
    """
    lines = [
        f"the tip is {1000 * fit.before:.1f} mm from where the model expects it; with "
        f"the session {1000 * fit.after:.1f} mm, on stretches that it was not fitted to"
    ]
    if not fit.improves:
        result = "no change surely lowers that: runs use no session; where the error is"
        return [*lines, f"{result} too large, check homing and tracking, or train anew"]
    if fit.change is not fit.posterior.change:
        result = "this is the earlier session, which runs go on with: this motion shows"
        return [*lines, f"{result} no change that predicts it better"]
    lines.append("runs use this session, which predicts the motion best")
    radii = 1000 * ArmGeometry.of(arm).cable_radii
    causes: dict[str, list[tuple]] = {
        "frame of the tracking": [
            ("translation", None, 1000, "mm of shift"),
            ("rotation", None, np.rad2deg(1.0), "deg of turn"),
        ],
        "homing or pretension of the cables": [
            (name, module, radius, unit)
            for module, radius in enumerate(radii)
            for name, unit in (("offsets", "mm off"), ("slack", "mm slack"))
        ],
        "softness": [("softness", module, 100, "%") for module in range(len(radii))],
    }
    unclear: dict[str, list[str]] = {}
    for cause, numbers in causes.items():
        names = list(dict.fromkeys(name for name, *_ in numbers))
        if _is_distinct(*fit.posterior.part(*names)):
            sizes = (_size(fit.posterior, *each) for each in numbers)
            lines.append(f"{cause}: {', '.join(filter(None, sizes)) or 'changed'}")
        else:
            unclear[cause] = names
    if unclear:
        is_changed = _is_distinct(*fit.posterior.part(*chain(*unclear.values())))
        result = "changed, alone or together"
        if not is_changed:
            result = "not distinguishable from none"
        lines.append(f"{' or '.join(unclear)}: {result}")
    return lines


def describe_disagreement(episode: Episode) -> str:
    """Describe that the seen tip is farther from its prediction than the model states.

    The prediction is that of the plan, moved by how far the sensed arm is from the plan:
    a goal that is not reached is no fault of the model. It counts within its data, where
    the sensed arm is as near to the plan as the stated deviation, and without a payload
    that is known (option `has_payload`): a session would not find that.

    The squared errors, relative to the stated variance (the normalized innovation
    squared), are compared with the chi-square distribution of as many independent
    samples as the run has. An insignificant error (`SIGNIFICANT`) does not count.

    Returns:
        Empty where they agree or do not count.
    """
    seen = next((name for name in SEEN if name in episode.sensors), None)
    lacks = COMPARED - episode.columns.keys()
    if seen is None or lacks or episode.options.get("has_payload"):
        return ""
    steps = episode.running
    steps = steps[steps + 1 < len(episode)]
    std = episode["predictive_std"][steps]
    outside = is_outside_data(std, episode["extrapolation"][steps])
    sensed = module_ends(episode.arm, episode["sensed"][steps + 1])
    tracked = (sensed - module_ends(episode.arm, episode["planned"][steps]))[:, -1]
    # far from the plan, arcs do not tell where the model expects the tip
    outside |= np.linalg.norm(tracked, axis=-1) > std[:, -1]
    predicted = episode["predicted"][steps, -1, POSITION] + tracked
    columns = np.column_stack([predicted, std[:, -1], outside])
    # a held arm has no prediction
    has_prediction = np.isfinite(columns).all(axis=-1)
    steps, columns = steps[has_prediction], columns[has_prediction]
    if len(steps) < 2:
        return ""
    # a step predicts the next row; pictures show an earlier one than that they are in
    shown = np.arange(len(episode)) - _ages(episode, seen)
    within = (shown >= steps[0] + 1) & (shown <= steps[-1] + 1)
    between = make_interp_spline(steps, columns, k=1)(shown[within] - 1)
    errors = episode.sensor(seen)[within, -1, POSITION] - between[:, POSITION]
    std = between[:, 3]
    known = np.isfinite(errors).all(axis=-1) & (std > 0.0) & (between[:, 4] == 0.0)
    if not known.any():
        return ""
    relative = np.sqrt(3.0) * errors[known] / std[known, None]
    time = samples_per_independent_one(relative)
    # of all coordinates of the samples that are independent
    freedom = relative.size / time
    if (relative**2).sum() / time <= chdtri(freedom, UNLIKELY):
        return ""
    distance = 1000 * np.sqrt((errors[known] ** 2).sum(axis=-1).mean())
    if distance <= 1000 * SIGNIFICANT * episode.arm.length:
        return ""
    stated = 1000 * np.sqrt((std[known] ** 2).mean())
    return (
        f"the tip was {distance:.1f} mm from its predictions, which state {stated:.1f} "
        "mm: if nothing hangs at the arm or pushes it, it has changed since the training; "
        "with weights of `s2c2a train`, run `s2c2a session`"
    )


class DisagreementWatch:
    """Compares the seen tip with its predictions while the arm moves.

    Attributes:
        text: what `describe_disagreement` says of the last whole stretch.
    """

    def __init__(self, arm: ArmSpec):
        """A watch that has seen nothing yet.

        Args:
            arm: that moves.
        """
        self.text = ""
        self._arm = arm
        self._length = round(WATCHED * arm.control_rate)
        self._steps: list[StepRecord] = []

    def add(self, steps: Iterable[StepRecord]) -> None:
        """Take the next steps; not on the control thread.

        The end of a stretch takes milliseconds.
        """
        self._steps += steps
        if len(self._steps) >= self._length:
            self.text = describe_disagreement(build_episode(self._steps, self._arm))
            self._steps = []


def _ages(episode: Episode, seen: str) -> Float[np.ndarray, " rows"]:
    """How many rows before its own each measurement of a sensor was taken."""
    camera = episode.arm.sensors.camera
    if seen != "camera_positions" or camera is None:
        return np.zeros(len(episode))
    ages = np.full(len(episode), camera.delay)
    if "camera_age" in episode.sensors:
        stated = episode.sensor("camera_age")
        ages = np.where(np.isfinite(stated), stated, ages)
    return ages / episode.arm.control_period


def _size(
    posterior: DayPosterior, part: str, module: int | None, factor: float, unit: str
) -> str:
    """Size of some numbers as text, with its standard deviation; one keeps its sign.

    Empty where it is not distinguishable from none, or within two deviations: numbers
    that are distinguishable in another direction than theirs alone.
    """
    value, covariance = posterior.part(part, module=module)
    if part == "softness":  # of a logarithm, the share
        value, covariance = np.expm1(value), np.exp(2.0 * value) * covariance
    if not _is_distinct(value, covariance):
        return ""
    size = float(np.linalg.norm(value))
    std = float(np.sqrt(value @ covariance @ value)) / size
    if size <= 2.0 * std:
        return ""
    shown = f"{factor * value[0]:+.1f}" if len(value) == 1 else f"{factor * size:.1f}"
    of_module = "" if module is None else f" in module {module + 1}"
    return f"{shown} ± {factor * std:.1f} {unit}{of_module}"


def _is_distinct(value: np.ndarray, covariance: np.ndarray) -> bool:
    """Whether some numbers are not none, by a chi-square test."""
    return value @ np.linalg.solve(covariance, value) > chdtri(len(value), UNLIKELY)
