"""Forward models on recordings of arms that nobody here made, on honest splits.

Rows that are held out are whole blocks, the end of a recording, or other recordings;
what cables remember is carried along the whole of it, as it is on the arm, and the
truth of those rows is never shown.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Bool

from s2c2a.arm import ArmSpec
from s2c2a.data import Recording, load_recording
from s2c2a.errors import RecordingError, StrategyError
from s2c2a.evaluation.report import Row, over_seeds
from s2c2a.models import C2SOptions, ChainOptions, ForwardOptions
from s2c2a.spaces import POSITION
from s2c2a.strategies import recipe_named, training_data
from s2c2a.studies.real_models import FittedArcs, KernelRegression, Recurrent
from s2c2a.training import FitOptions, TrainingData

EXPERIMENT = "real"
HELD_OUT_BLOCKS = (6, 13, 19)  # of every twenty
BEST = recipe_named("best")
PAPER = recipe_named("paper")
MODELS: dict[str, tuple[ForwardOptions, FitOptions]] = {
    "best": (BEST.c2s, BEST.c2s_fit),
    "chain": (ChainOptions(), BEST.c2s_fit),
    "paper": (C2SOptions(layers=4, hidden=64), PAPER.c2s_fit),
    "pcc-fitted": (FittedArcs(), PAPER.c2s_fit),
    "kernels": (KernelRegression(plays=False), PAPER.c2s_fit),
    "kernels with plays": (KernelRegression(), PAPER.c2s_fit),
    "recurrent": (Recurrent(), BEST.c2s_fit),
}


@dataclass(frozen=True)
class Held:
    """What is held out of a recording.

    Attributes:
        name: in the rows.
        rows: which, shape (episodes, samples).
    """

    name: str
    rows: Bool[np.ndarray, "episodes samples"]


def blocks_of(recording: Recording, size: int) -> Held:
    """Of every twenty blocks of so many rows the 7th, 14th and 20th, over all episodes in turn.

    Raises:
        RecordingError: it has too few.
    """
    rows = np.zeros((len(recording.episodes), max(recording.lengths)), bool)
    before = 0
    for mine, length in zip(rows, recording.lengths, strict=True):
        numbers = (before + np.arange(length)) // size
        mine[:length] = np.isin(numbers % 20, HELD_OUT_BLOCKS)
        before += length
    if not rows.any():
        raise RecordingError(
            f"blocks of {size} rows hold nothing out of {before}; take smaller ones"
        )
    return Held(f"blocks of {size}", rows)


def last_of(recording: Recording, count: int) -> Held:
    """The last rows of the last episode.

    Raises:
        RecordingError: it has not so many.
    """
    if not 0 < count < recording.lengths[-1]:
        raise RecordingError(
            f"the last {count} rows asked for; the last episode has {recording.lengths[-1]}"
        )
    rows = np.zeros((len(recording.episodes), max(recording.lengths)), bool)
    rows[-1, recording.lengths[-1] - count : recording.lengths[-1]] = True
    return Held(f"last {count}", rows)


class Asked(NamedTuple):
    """What is held against what.

    Attributes:
        recording: to learn from.
        splits: of it.
        unseen: other recordings of the same arm, tried as a whole, by the names of
            their files.
        models: names of `MODELS`.
    """

    recording: Recording
    splits: tuple[Held, ...]
    unseen: dict[str, Recording]
    models: tuple[str, ...]

    @classmethod
    def of(
        cls,
        recording: Path,
        unseen: Sequence[Path],
        block: int,
        last: int,
        models: Sequence[str],
    ) -> "Asked":
        """From files.

        Args:
            recording: to learn from.
            unseen: other recordings.
            block: rows of each block that is held out; none if zero.
            last: rows at the end that are held out; none if zero.
            models: names of `MODELS`; all if empty.

        Raises:
            RecordingError: a recording that is none, or of another arm, or too short;
                nothing to be tried on.
            StrategyError: no such model.
        """
        names = tuple(models) or tuple(MODELS)
        whole = load_recording(recording)
        if strange := [name for name in names if name not in MODELS]:
            raise StrategyError(
                f"no model {', '.join(strange)} to compare; choose among {', '.join(MODELS)}"
            )
        others = {str(path.with_suffix("")): load_recording(path) for path in unseen}
        for name, other in others.items():
            if _kind(other.arm) != _kind(whole.arm):
                said = f"{name} is of {_kind(other.arm)}, {Path(recording).stem} of {_kind(whole.arm)}"
                raise RecordingError(
                    f"{said}; give recordings of one arm, imported --like the first"
                )
        if min(block, last) < 0:
            raise RecordingError(
                f"--block {block} and --last {last} asked for; say zero or more rows"
            )
        asked = ((blocks_of, block), (last_of, last))
        splits = tuple(held_out(whole, count) for held_out, count in asked if count > 0)
        if not (others or splits):
            raise RecordingError(
                f"--block {block} and --last {last} hold nothing out; say some, or --unseen RECORDING"
            )
        nothing = Held(
            "nothing", np.zeros((len(whole.episodes), max(whole.lengths)), bool)
        )
        return cls(whole, splits or (nothing,), others, names)


def _kind(arm: ArmSpec) -> str:
    return f"{arm.name} ({arm.module_count} modules of {arm.cable_count} cables, {arm.actuation})"


def real_rows(
    asked: Asked, seeds: Sequence[int], progress: Callable[[str, int, int], None]
) -> list[Row]:
    """Rows of every split and model.

    Args:
        asked: what is tried.
        seeds: of training.
        progress: told what, how many of how many.
    """
    rows: list[Row] = []
    for number, (held, name) in enumerate(product(asked.splits, asked.models)):
        progress("models", number, len(asked.splits) * len(asked.models))
        unseen = asked.unseen if held is asked.splits[-1] else {}
        rows += held_rows(asked.recording, held, [name], seeds, unseen)
    return rows


def held_rows(
    recording: Recording,
    held: Held,
    models: Sequence[str],
    seeds: Sequence[int],
    unseen: Mapping[str, Recording] | None = None,
) -> Iterator[Row]:
    """Rows of one split, a model after the other: errors of the tip where it is known [mm].

    Args:
        recording: to learn from.
        held: what of it is held out.
        models: names of `MODELS`.
        seeds: of training.
        unseen: other recordings of the same arm, tried as a whole, by name.
    """
    data = training_data(recording, BEST)
    states = np.array(data.states)
    states[held.rows] = np.nan
    others = [
        (name, training_data(other, BEST), None)
        for name, other in (unseen or {}).items()
    ]
    tried = [(held.name, data, held.rows)] * bool(held.rows.any()) + others
    for name in models:
        options, fit = MODELS[name]
        trained = [
            options.train(
                replace(data, states=states), fit, jax.random.key(seed)
            ).network
            for seed in seeds
        ]
        for split, where, rows in tried:
            errors = [_errors(options, network, where, rows) for network in trained]
            yield from _as_rows(recording, split, name, errors, seeds)


def _errors(
    options: ForwardOptions, network, data: TrainingData, rows: np.ndarray | None
) -> np.ndarray:
    """Distances of the tip from where it was said to be [mm]."""
    said = options.answers(network, data)
    distances = 1e3 * np.linalg.norm((said - data.states)[:, :, -1, POSITION], axis=-1)
    counted = np.isfinite(data.states[:, :, -1, POSITION]).all(axis=-1)
    for mine, length in zip(counted, data.lengths or (), strict=False):
        mine[length:] = False
    return distances[counted if rows is None else counted & rows]


MEASURES: dict[str, Callable[[np.ndarray], np.floating]] = {
    "tip": np.mean,
    "tip, rms": lambda errors: np.sqrt(np.mean(errors**2)),
    "tip, 95 %": lambda errors: np.percentile(errors, 95),
}


def _as_rows(
    recording: Recording,
    split: str,
    name: str,
    errors: list[np.ndarray],
    seeds: Sequence[int],
) -> list[Row]:
    arm = recording.arm.name
    heading = EXPERIMENT, f"{arm}, {split}", arm, "real", name, name
    return [
        Row(*heading, metric, "mm", seeds=tuple(seeds), **over_seeds(values, spreads))
        for metric, measure in MEASURES.items()
        for values in [[float(measure(one)) for one in errors]]
        for spreads in [[float(one.std()) for one in errors] if metric == "tip" else []]
    ]
