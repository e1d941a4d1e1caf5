"""What a fit says: numbers with their uncertainty, what cannot be told apart, and the twin's error."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from s2c2a.arm import arm_to_toml
from s2c2a.episodes import Episode
from s2c2a.identification.fitting import Belief, Fit
from s2c2a.identification.numbers import Path
from s2c2a.identification.problem import FRAME_SPREAD, begun, held_out
from s2c2a.spaces import POSITION, States

UNSEEN = 0.7  # spreads: a number that is known no better than this was hardly seen
NAMED = 0.3  # a combination's parts that are worth a word


@dataclass(frozen=True)
class TipErrors:
    """Distances of the simulated from the recorded end of the outermost module that was seen [m].

    Attributes:
        rows: how many.
        mean: of the distances.
        rms: of the distances.
        rms_centered: the same, after the mean difference is taken out.
        most: 95 % are below.
    """

    rows: int
    mean: float
    rms: float
    rms_centered: float
    most: float


def tip_errors(
    predicted: Sequence[States], episodes: Sequence[Episode], rows: Sequence[np.ndarray]
) -> TipErrors | None:
    """Errors in some rows of episodes, none where nothing was seen in them.

    Args:
        predicted: states, one array an episode.
        episodes: with the sensor `states`.
        rows: which of each episode count, true or false.
    """
    pairs = zip(predicted, episodes, rows, strict=True)
    apart = np.concatenate(
        [
            (one - episode.sensor("states"))[kept][..., POSITION]
            for one, episode, kept in pairs
        ]
    )
    seen = np.flatnonzero(np.isfinite(apart).all(axis=-1).any(axis=0))
    if not len(seen):
        return None
    tip = apart[:, seen[-1]]
    tip = tip[np.isfinite(tip).all(axis=-1)]
    far, centered = (
        np.linalg.norm(one, axis=-1) for one in (tip, tip - tip.mean(axis=0))
    )
    rms, rms_centered = (float(np.sqrt(np.mean(one**2))) for one in (far, centered))
    return TipErrors(
        len(tip), float(far.mean()), rms, rms_centered, float(np.percentile(far, 95))
    )


def errors_of(
    fit: Fit, others: Mapping[str, Sequence[Episode]]
) -> dict[str, TipErrors]:
    """Errors in rows that were fitted, in those that were kept from it, and in other recordings.

    First rows do not count where what came before them is not known.
    """
    episodes = fit.problem.episodes
    one_session = fit.problem.options.replay.one_session
    predicted = fit.predicted(episodes)
    kept = held_out(episodes, one_session)
    unknown = begun(episodes, one_session)
    counted = {
        "fitted rows": tip_errors(predicted, episodes, [~rows for rows in kept]),
        "held-out rows": tip_errors(
            predicted, episodes, [a & ~b for a, b in zip(kept, unknown, strict=True)]
        ),
    }
    for name, other in others.items():
        counted[name] = tip_errors(
            fit.predicted(other), other, [~rows for rows in begun(other, one_session)]
        )
    return {name: errors for name, errors in counted.items() if errors}


@dataclass(frozen=True)
class Found:
    """One number: what the file said, what was found, its standard deviation, whether the recording shows it."""

    name: str
    start: float
    value: float
    deviation: float
    seen: bool


def found_numbers(fit: Fit) -> list[Found]:
    """Every number that was fitted, those of the frame last [rad, m]."""
    unknowns = fit.problem.unknowns
    belief = fit.belief
    numbers = [
        Found(
            one.name,
            one.start,
            one.value(place),
            one.slope(place) * deviation,
            bool(deviation < UNSEEN),
        )
        for one, place, deviation in zip(
            unknowns, fit.coordinates, belief.deviations, strict=False
        )
    ]
    units = FRAME_SPREAD * np.repeat([1.0, fit.problem.arm.length], 3)
    rest = slice(len(unknowns), None)
    frame = zip(
        belief.names[rest],
        units,
        fit.coordinates[rest],
        belief.deviations[rest],
        strict=False,
    )
    return numbers + [
        Found(name, 0.0, unit * at, unit * off, bool(off < UNSEEN))
        for name, unit, at, off in frame
    ]


def untold(belief: Belief) -> list[str]:
    """Combinations that the recording says less of than the file did, the least known first; alone or together."""
    least = [
        row
        for row, known in zip(belief.combinations, belief.information, strict=True)
        if known < 1.0
    ]
    return list(dict.fromkeys(_in_words(row, belief.names) for row in least))


def _in_words(
    direction: Float[np.ndarray, " coordinates"], names: Sequence[str]
) -> str:
    """Such as `0.8 modules.0.mass - 0.6 modules.1.mass`, the largest part positive."""
    order = np.argsort(-np.abs(direction))
    named = [place for place in order if abs(direction[place]) > NAMED] or order[:3]
    parts = direction * np.sign(direction[order[0]])
    text = " ".join(
        f"{'-' if parts[place] < 0 else '+'} {abs(parts[place]):.1f} {names[place]}"
        for place in named
    )
    return text.removeprefix("+ ")


def fitted_toml(fit: Fit, remark: str = "") -> str:
    """The fitted arm as an arm file, each number with its standard deviation beside it."""
    numbers = zip(fit.problem.unknowns, found_numbers(fit), strict=False)
    remarks = {one.path: _remark(found) for one, found in numbers}
    lines = [
        _with_remark(line, path, remarks)
        for path, line in _lines_with_paths(arm_to_toml(fit.arm))
    ]
    said = "".join(f"# {line}\n" for line in remark.splitlines())
    return (
        f"{said}# Behind +- stands one standard deviation.\n" + "\n".join(lines) + "\n"
    )


def _remark(found: Found) -> str:
    return f"+- {found.deviation:.2g}, was {found.start:.5g}" + (
        "" if found.seen else "; hardly seen"
    )


def _with_remark(line: str, path: Path, remarks: Mapping[Path, str]) -> str:
    """What is said of a number, or of the components that it is the size of, or of every cable."""
    said = (
        [remarks[path]]
        if path in remarks
        else [text for place, text in remarks.items() if place[:-1] == path]
    )
    if not said or line.endswith("["):
        return line
    return f"{line}  # {said[0] if len(said) == 1 else 'each: ' + ' | '.join(said)}"


def _lines_with_paths(text: str) -> Iterator[tuple[Path, str]]:
    """Lines of an arm file, each with the place of the number that stands in it."""
    table: Path = ()
    module = -1
    place = 0
    key = ""
    for line in text.splitlines():
        if line.startswith("[["):
            module += 1
            table = ("modules", module)
        elif line.startswith("["):
            inner = tuple(line.strip("[]").split("."))
            table = ("modules", module, *inner[1:]) if inner[0] == "modules" else inner
        if line.startswith(" "):
            yield (*table, key, place), line
            place += 1
            continue
        key = line.split(" = ")[0]
        place = 0
        yield (*table, key), line
