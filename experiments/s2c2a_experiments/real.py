"""Forward models compared on recordings of real arms, with held-out data.

Held-out samples are blocks, those with the largest pulls, or other recordings. The
hysteresis state follows the whole recording, as on the arm; the true states of held-out
samples are hidden from training, and so are those beside them: neighbors in time are
alike, and a model that interpolates them would look better than it is.
"""

from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from os.path import commonpath
from pathlib import Path
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import binary_dilation, label

from s2c2a.arm import ArmSpec
from s2c2a.data import Recording, load_recording
from s2c2a.episodes import Episode
from s2c2a.errors import RecordingError, counted
from s2c2a.evaluation.report import Row, over_seeds
from s2c2a.models import C2SOptions, ChainOptions, ForwardOptions
from s2c2a.strategies import recipe_named, training_data
from s2c2a.training import FitOptions, TrainingData
from s2c2a_experiments.real_models import FittedArcs, KernelRegression
from s2c2a_experiments.real_process import Process
from s2c2a_experiments.real_scores import Mask, TipScores, tip_scores

EXPERIMENT = "real"
HELD_OUT_BLOCKS = (6, 13, 19)  # of every twenty
STRETCH_END = 0.9  # of the threshold of a stretch of large pulls
LARGEST = 0.15  # held-out share of the rows, those with the largest pulls
MAX_LARGEST = 0.5  # share of the rows with the largest pulls
BLOCK = 25  # rows of a held-out block
GAP = 25  # rows over which errors of recorded arms are correlated
BEST = recipe_named("best")
PAPER = recipe_named("paper")
MODELS: dict[str, tuple[ForwardOptions, FitOptions]] = {
    "best": (BEST.c2s, BEST.c2s_fit),
    "chain": (ChainOptions(), BEST.c2s_fit),
    "paper": (C2SOptions(layers=4, hidden=64), PAPER.c2s_fit),
    "pcc-fitted": (FittedArcs(), PAPER.c2s_fit),
    "kernels with plays": (KernelRegression(), PAPER.c2s_fit),
    "process": (Process(), PAPER.c2s_fit),
    "chain + process": (Process(chain=True), BEST.c2s_fit),
}


@dataclass(frozen=True)
class HeldOutSplit:
    """Held-out samples of a recording.

    Attributes:
        name: in the rows.
        held_out: mask of these samples, shape (episodes, samples).
    """

    name: str
    held_out: Mask

    def hidden(self, gap: int) -> Mask:
        """Held-out samples and so many on either side of them, within an episode."""
        neighbors = np.ones((1, 2 * gap + 1), bool)
        return binary_dilation(self.held_out, neighbors)


def _no_samples(recording: Recording) -> np.ndarray:
    return np.zeros((len(recording.episodes), max(recording.lengths)), bool)


def hidden_from(data: TrainingData, split: HeldOutSplit, gap: int) -> TrainingData:
    """Data for training, without the states of held-out samples and those beside them."""
    states = np.array(data.states)
    states[split.hidden(gap)] = np.nan
    return replace(data, states=states)


def split_blocks(recording: Recording, size: int) -> HeldOutSplit:
    """Hold out the 7th, 14th and 20th of every twenty blocks over all episodes.

    Args:
        recording: to split.
        size: samples of a block.

    Raises:
        RecordingError: the recording has too few samples.
    """
    held_out = _no_samples(recording)
    total = 0
    for row, length in zip(held_out, recording.lengths, strict=True):
        blocks = (total + np.arange(length)) // size
        row[:length] = np.isin(blocks % 20, HELD_OUT_BLOCKS)
        total += length
    if not held_out.any():
        raise RecordingError(
            f"blocks of {counted(size, 'row')} hold nothing out of {total} rows; "
            f"give a block of at most {total // (HELD_OUT_BLOCKS[0] + 1)} rows"
        )
    return HeldOutSplit(f"blocks of {size}", held_out)


def split_largest(recording: Recording, share: float) -> HeldOutSplit:
    """Hold out the samples with the largest pulls, as whole stretches.

    A pull is the norm of the displacements from rest [m], or tensions [N], of all
    cables. A stretch reaches a threshold and ends where the pull falls below
    `STRETCH_END` of it. Of all thresholds, the lowest is used whose stretches have at
    most this share of the samples.

    Args:
        recording: to split.
        share: largest share of the samples, above 0 and at most 0.5.

    Raises:
        RecordingError: the share is out of range, or no stretch is short enough.
    """
    if not 0 < share <= MAX_LARGEST:
        raise RecordingError(
            f"cannot hold out a share of {share:g} with the largest pulls; give a share "
            f"above 0 and at most {MAX_LARGEST:g}, such as 0.15"
        )
    pulls = [_pulls(episode) for episode in recording.episodes]
    limit = share * sum(recording.lengths)
    thresholds = np.unique(np.concatenate(pulls))

    def is_within_limit(threshold: float) -> bool:
        counts = [int(_large_pulls(values, threshold).sum()) for values in pulls]
        return sum(counts) <= limit

    # bisection: a higher threshold never holds out more samples
    first = bisect_left(thresholds, True, key=is_within_limit)
    if first == len(thresholds):
        raise RecordingError(
            f"no stretch of the largest pulls has at most {100 * share:g} % of the rows; "
            "give a longer recording"
        )
    held_out = _no_samples(recording)
    for row, values in zip(held_out, pulls, strict=True):
        row[: len(values)] = _large_pulls(values, thresholds[first])
    return HeldOutSplit(f"largest {100 * share:g} %", held_out)


def _pulls(episode: Episode) -> Float[np.ndarray, " samples"]:
    """Norm of the displacements [m] or tensions [N] of all cables."""
    measured = "cables" in episode.sensors
    cables = episode.sensor("cables") if measured else episode["actions"]
    return np.linalg.norm(cables.reshape(len(cables), -1), axis=1)


def _large_pulls(
    pulls: Float[np.ndarray, " samples"], threshold: float
) -> Bool[np.ndarray, " samples"]:
    """Mask of the stretches that reach a threshold (`split_largest`)."""
    stretches, _ = label(pulls >= STRETCH_END * threshold)
    return np.isin(stretches, np.unique(stretches[pulls >= threshold]))


class RealComparison(NamedTuple):
    """Recordings, splits and models to compare.

    Attributes:
        recording: to train on.
        splits: of it.
        unseen: other recordings of the same arm, for tests only, by name. They judge
            a training on the whole recording: the split that holds nothing out.
        models: names of `MODELS`.
        gap: samples beside held-out ones that nothing uses.
    """

    recording: Recording
    splits: tuple[HeldOutSplit, ...]
    unseen: dict[str, Recording]
    models: tuple[str, ...]
    gap: int = GAP

    @classmethod
    def of(cls, recording: Path, unseen: Sequence[Path] = ()) -> "RealComparison":
        """All models by held-out blocks, the largest pulls, and other recordings.

        Args:
            recording: to train on.
            unseen: other recordings.

        Raises:
            RecordingError: a file is no recording, is of another arm, or is too short.
        """
        whole = load_recording(recording)
        others = recordings_by_name(unseen)
        for name, other in others.items():
            _check_same_arm(name, other.arm, Path(recording).stem, whole.arm)
        splits = [split_blocks(whole, BLOCK), split_largest(whole, LARGEST)]
        if others:
            splits.append(HeldOutSplit("nothing", _no_samples(whole)))
        return cls(whole, tuple(splits), others, tuple(MODELS))


def recordings_by_name(paths: Sequence[Path]) -> dict[str, Recording]:
    """Recordings by their paths in the folder that holds them all, wherever that is.

    Raises:
        RecordingError: a file is no recording.
    """
    files = [path.resolve().with_suffix("") for path in paths]
    folder = commonpath([file.parent for file in files]) if files else ""
    names = [file.relative_to(folder).as_posix() for file in files]
    return dict(zip(names, map(load_recording, paths), strict=True))


def _check_same_arm(
    name: str, arm: ArmSpec, first_name: str, first_arm: ArmSpec
) -> None:
    if _description(arm) != _description(first_arm):
        raise RecordingError(
            f"{name} is of {_description(arm)}, {first_name} of "
            f"{_description(first_arm)}; give recordings of one arm, imported --like "
            "the first"
        )


def _description(arm: ArmSpec) -> str:
    return (
        f"{arm.name} ({counted(arm.module_count, 'module')} of "
        f"{counted(arm.cable_count, 'cable')}, {arm.actuation})"
    )


def real_rows(
    comparison: RealComparison,
    seeds: Sequence[int],
    progress: Callable[[str, int, int], None],
    keep: Callable[[list[Row]], object] = lambda rows: None,
) -> list[Row]:
    """Make rows of every split and model.

    Args:
        comparison: recordings, splits and models.
        seeds: of training.
        progress: called with a label, the number done and the total.
        keep: called with all rows so far whenever a model is finished, so that an
            interruption loses none.
    """
    rows: list[Row] = []
    pairs = list(product(comparison.splits, comparison.models))
    for number, (split, name) in enumerate(pairs):
        progress("models", number, len(pairs))
        unseen = {} if split.held_out.any() else comparison.unseen
        rows += split_rows(
            comparison.recording, split, [name], seeds, unseen, comparison.gap
        )
        keep(rows)
    return rows


def split_rows(
    recording: Recording,
    split: HeldOutSplit,
    models: Sequence[str],
    seeds: Sequence[int],
    unseen: Mapping[str, Recording] | None = None,
    gap: int = GAP,
) -> Iterator[Row]:
    """Make rows of one split, model by model: scores of the tip where it is known.

    Args:
        recording: to train on.
        split: its held-out samples.
        models: names of `MODELS`.
        seeds: of training.
        unseen: other recordings of the same arm, for tests only, by name.
        gap: samples beside held-out ones that nothing uses.
    """
    data = training_data(recording, BEST)
    training = hidden_from(data, split, gap)
    tests = []
    if split.held_out.any():
        title = f"{split.name}, gap {gap}"
        tests.append(_Test(title, data, split.held_out, split.hidden(gap)))
    for name, other in (unseen or {}).items():
        other_data = training_data(other, BEST)
        everything = np.ones(other_data.states.shape[:2], bool)
        tests.append(_Test(name, other_data, everything, everything))
    for name in models:
        options, fit = MODELS[name]
        networks = [
            options.train(training, fit, jax.random.key(seed)).network for seed in seeds
        ]
        for test in tests:
            scores = [
                tip_scores(options, network, training, *test[1:])
                for network in networks
            ]
            yield from _score_rows(recording.arm.name, test.name, name, scores, seeds)


class _Test(NamedTuple):
    """Samples that judge: the first attribute is in the rows, `tip_scores` takes others."""

    name: str
    data: TrainingData
    judged: Mask
    hidden: Mask


def _score_rows(
    arm: str, split: str, model: str, scores: list[TipScores], seeds: Sequence[int]
) -> list[Row]:
    """Rows of one split and model; without rank correlation if a deviation is constant."""
    rows = []

    def add(
        metric: str, unit: str, values: list, spreads: Sequence[float] = ()
    ) -> None:
        heading = (EXPERIMENT, f"{arm}, {split}", arm, "real", model, model)
        statistics = over_seeds([float(value) for value in values], spreads)
        rows.append(Row(*heading, metric, unit, seeds=tuple(seeds), **statistics))

    distances = [each.distances for each in scores]
    spreads = [float(each.std()) for each in distances]
    add("tip", "mm", [each.mean() for each in distances], spreads)
    add("tip, rms", "mm", [np.sqrt(np.mean(each**2)) for each in distances])
    add("tip, 95 %", "mm", [np.percentile(each, 95) for each in distances])
    add("log likelihood", "nats", [each.log_likelihood for each in scores])
    add("coverage", "share", [each.coverage for each in scores])
    correlations = [each.rank_correlation for each in scores]
    if None not in correlations:
        add("rank correlation", "1", correlations)
    add("correlation time", "rows", [each.correlation_time for each in scores])
    return rows
