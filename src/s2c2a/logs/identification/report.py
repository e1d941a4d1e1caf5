"""Report of a fit: numbers with uncertainty, ambiguous combinations, and tip errors."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from s2c2a.arm import arm_to_toml
from s2c2a.episodes import Episode
from s2c2a.logs.arm_file import toml_comment
from s2c2a.logs.identification.fitting import Fit, Posterior
from s2c2a.logs.identification.problem import FRAME_SPREAD, first_rows, held_out
from s2c2a.spaces import POSITION, States

UNSEEN = 0.7  # posterior over prior std from which a number is hardly determined
NAMED = 0.3  # smallest component of a combination that is printed


@dataclass(frozen=True)
class TipErrors:
    """Errors of the outermost measured end [m].

    Attributes:
        rows: number of rows.
        mean: mean distance.
        rms: root-mean-square distance.
        rms_centered: the same without the mean offset.
        most: 95th percentile of the distance.
    """

    rows: int
    mean: float
    rms: float
    rms_centered: float
    most: float


def tip_errors(
    predicted: Sequence[States], episodes: Sequence[Episode], rows: Sequence[np.ndarray]
) -> TipErrors | None:
    """Errors in some rows of episodes, None if no end is measured in them.

    Args:
        predicted: predicted states, one array for each episode.
        episodes: episodes with the sensor `states`.
        rows: mask of the rows of each episode.
    """
    parts = [
        (states - episode.sensor("states"))[mask][..., POSITION]
        for states, episode, mask in zip(predicted, episodes, rows, strict=True)
    ]
    errors = np.concatenate(parts)
    measured = np.flatnonzero(np.isfinite(errors).all(axis=-1).any(axis=0))
    if not len(measured):
        return None
    tip = errors[:, measured[-1]]
    tip = tip[np.isfinite(tip).all(axis=-1)]
    distance = np.linalg.norm(tip, axis=-1)
    centered = np.linalg.norm(tip - tip.mean(axis=0), axis=-1)
    return TipErrors(
        len(tip),
        float(distance.mean()),
        _rms(distance),
        _rms(centered),
        float(np.percentile(distance, 95)),
    )


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def errors_of(
    fit: Fit, others: Mapping[str, Sequence[Episode]]
) -> dict[str, TipErrors]:
    """Errors in fitted rows, held-out rows, and other recordings.

    First rows with an unknown history are not evaluated.
    """
    episodes = fit.problem.episodes
    one_take = fit.problem.options.replay.one_take
    predicted = fit.predicted(episodes)
    excluded = held_out(episodes, one_take)
    first = first_rows(episodes, one_take)
    fitted_rows = [~mask for mask in excluded]
    held_out_rows = [a & ~b for a, b in zip(excluded, first, strict=True)]
    errors = {
        "fitted rows": tip_errors(predicted, episodes, fitted_rows),
        "held-out rows": tip_errors(predicted, episodes, held_out_rows),
    }
    for name, other in others.items():
        rows = [~mask for mask in first_rows(other, one_take)]
        errors[name] = tip_errors(fit.predicted(other), other, rows)
    return {name: value for name, value in errors.items() if value}


@dataclass(frozen=True)
class FittedNumber:
    """Fitted number.

    Attributes:
        name: dotted path in the arm file.
        start: value before the fit.
        value: fitted value.
        deviation: standard deviation.
        seen: whether the recording determines it.
    """

    name: str
    start: float
    value: float
    deviation: float
    seen: bool


def fitted_numbers(fit: Fit) -> list[FittedNumber]:
    """All fitted numbers, those of the frame last [rad, m]."""
    unknowns = fit.problem.unknowns
    starts = [unknown.start for unknown in unknowns]
    values = []
    slopes = []
    for unknown, coordinate in zip(unknowns, fit.coordinates, strict=False):
        values.append(unknown.value(coordinate))
        slopes.append(unknown.slope(coordinate))
    names = fit.posterior.names
    if len(names) > len(unknowns):  # the frame is fitted too
        scales = FRAME_SPREAD * np.repeat([1.0, fit.problem.arm.length], 3)
        starts += [0.0] * len(scales)
        values += (scales * fit.coordinates[len(unknowns) :]).tolist()
        slopes += scales.tolist()
    std = fit.posterior.std
    columns = zip(names, starts, values, slopes * std, std < UNSEEN, strict=True)
    return [
        FittedNumber(name, start, value, float(deviation), bool(seen))
        for name, start, value, deviation, seen in columns
    ]


def undetermined_combinations(posterior: Posterior) -> list[str]:
    """Combinations that the recording determines less than the prior, worst first."""
    names = posterior.names
    texts = [
        _format_combination(row, names)
        for row, information in zip(
            posterior.combinations, posterior.information, strict=True
        )
        if information < 1.0
    ]
    return list(dict.fromkeys(texts))


def _format_combination(
    direction: Float[np.ndarray, " coordinates"], names: Sequence[str]
) -> str:
    """Text such as `0.8 modules.0.mass - 0.6 modules.1.mass`, largest part positive."""
    order = np.argsort(-np.abs(direction))
    large = [index for index in order if abs(direction[index]) > NAMED]
    shown = large or order[:3]
    parts = direction * np.sign(direction[order[0]])
    terms = [
        f"{'-' if parts[index] < 0 else '+'} {abs(parts[index]):.1f} {names[index]}"
        for index in shown
    ]
    return " ".join(terms).removeprefix("+ ")


def fitted_toml(fit: Fit, remark: str = "") -> str:
    """Text of the fitted arm's file, below a comment on each fitted number."""
    numbers = fitted_numbers(fit)[: len(fit.problem.unknowns)]
    lines = [
        *remark.splitlines(),
        "+- is one standard deviation.",
        *map(_comment, numbers),
    ]
    return "\n".join([*map(toml_comment, lines), arm_to_toml(fit.arm)])


def _comment(number: FittedNumber) -> str:
    text = (
        f"{number.name}: {number.value:.5g} +- {number.deviation:.2g}, "
        f"was {number.start:.5g}"
    )
    return text if number.seen else f"{text}; hardly seen"
