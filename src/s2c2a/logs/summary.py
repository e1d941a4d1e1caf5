"""Text summary of an import."""

from collections.abc import Iterable, Iterator

import numpy as np

from s2c2a.errors import counted
from s2c2a.logs.command_range import describe_range
from s2c2a.logs.map_diagnosis import MOST, rms_motion
from s2c2a.logs.pipeline import Imported, ImportedTake
from s2c2a.logs.take_change import TakeChange, describe_change
from s2c2a.spaces import POSITION


def cable_rows(imported: Imported) -> Iterator[tuple[str, ...]]:
    """Row for each cable: column, module, angle, effect of larger numbers, gain."""
    layout = imported.layout
    std = imported.fit.std
    is_tension = imported.arm.actuation == "tension"
    for module, cable in np.argwhere(layout.present):
        drive = layout.drive[module, cable]
        angle_std = np.rad2deg(std.angles[drive]) if std else np.nan
        gain_std = std.gains[drive] if std else np.nan
        # a tension pulls; a displacement above zero, and a pressure, release
        pulls = is_tension or layout.factor[module, cable] < 0
        yield (
            imported.rig.names[drive],
            str(module + 1),
            f"{layout.angles_deg[module, cable]:.1f} +- {angle_std:.1f}",
            "pull" if pulls else "release",
            f"{layout.gains[module, cable]:.3f} +- {gain_std:.3f}",
        )


def summary(imported: Imported) -> list[str]:
    """Lines: episodes, steps, measured ends, residual, frame, and ambiguities."""
    rig = imported.rig
    effect = "bend" if imported.assignment.coupled else "do not bend"
    lines = [
        *_describe_episodes(imported),
        f"model: its ends are {1e3 * imported.residual:.1f} mm (rms) from the measured "
        f"ones; cables of outer modules {effect} inner modules",
        f"base in the frame of the log: {_vector(rig.base)} m, "
        f"x along {_vector(rig.axes[0])}, z along {_vector(rig.axes[2])}",
        _describe_lengths(imported),
        *describe_range(imported.episodes),
    ]
    warnings = [imported.diagnosis, imported.poor_fit]
    if not imported.diagnosis:  # it may be why the numbers are wrong
        warnings.append(imported.contradictions)
    if imported.undetermined and not imported.diagnosis:
        warnings.append(
            f"the log does not determine {', '.join(imported.undetermined)}: record "
            "motion of every drive in both directions, or state in the map what you know"
        )
    if imported.unusual and not imported.diagnosis:
        warnings.append(
            f"unusual: {'; '.join(imported.unusual)}: check units, offsets and frame"
        )
    if imported.interpolated:
        warnings.append(
            f"{imported.interpolated}: most lie between rows; check rows.unit, or state "
            "an arm.control_rate near the rate of the rows"
        )
    lines += [f"warning: {text}" for text in warnings if text]
    doubts = () if imported.diagnosis else imported.ambiguities
    return lines + [f"ambiguous: {text}" for text in doubts]


def verdict(imported: Imported) -> str:
    """One line: whether the recording and the arm can be used, and why not."""
    states = np.concatenate([each.sensor("states") for each in imported.episodes])
    is_measured = np.isfinite(states[..., 0]).any(axis=0)
    motion = rms_motion(states[:, is_measured, POSITION])
    missed = f"the model misses {100 * imported.residual / motion:.0f} % of the motion"
    if imported.diagnosis:
        return "not usable (the map contradicts the log)"
    if imported.residual > MOST * motion:
        return f"not usable ({missed})"
    if any(text.startswith("angle") for text in imported.undetermined):
        return "not usable (the log does not determine the cables)"
    # the lowest pressure of every step; a zero that drifts is below in few
    lowest = np.concatenate(
        [each["actions"].min(axis=(1, 2)) for each in imported.episodes]
    )
    is_vacuum = imported.arm.actuation == "pressure" and lowest.min() < 0.0
    unsupported = "pressures below zero are not supported"
    if is_vacuum and np.median(lowest) < 0.0:
        return f"not usable ({unsupported})"
    names = (text.split(":")[0] for text in imported.ambiguities)
    doubts = ", ".join(dict.fromkeys(names))
    reasons = {
        unsupported: is_vacuum,
        missed: imported.poor_fit,
        "stated values are contradicted": imported.contradictions,
        "numbers are not determined": imported.undetermined,
        "numbers are unusual": imported.unusual,
        f"not determined by this log: {doubts}": doubts,
        "the frame moves": imported.segments.frame_motions,
        "most steps lie between rows": imported.interpolated,
    }
    given = [reason for reason, why in reasons.items() if why]
    return f"usable with care ({'; '.join(given)})" if given else "usable"


def _describe_lengths(imported: Imported) -> str:
    fit = imported.fit
    lengths = 1e3 * np.exp(fit.parameters.lengths)
    deviations = lengths * fit.std.lengths if fit.std else np.full_like(lengths, np.nan)
    modules = [
        f"{length:.1f} +- {deviation:.1f}"
        for length, deviation in zip(lengths, deviations, strict=True)
    ]
    return (
        f"lengths: modules {', '.join(modules)} mm, in all {lengths.sum():.1f} mm; "
        "compare them with a ruler"
    )


def take_summary(take: ImportedTake) -> list[str]:
    """Lines: the same for another take, and the tip's offset from the first one."""
    return [
        *_describe_episodes(take),
        *describe_range(take.episodes),
        "frame and cables: as in the first recording",
        _describe_offset(take.change),
        *([describe_change(take.change)] if take.change else []),
    ]


def _describe_offset(change: TakeChange | None) -> str:
    tips = np.zeros((0, 3)) if change is None else change.tips
    tips = tips[np.isfinite(tips).all(axis=-1)]
    if not len(tips):
        return (
            "offset of the tip: unknown, because the two takes do not both measure "
            "the tip in enough steps with similar cables; whether a camera or motor "
            "has moved cannot be checked"
        )
    distance = 1e3 * np.median(np.linalg.norm(tips, axis=-1))
    offset = _vector(1e3 * np.median(tips, axis=0), 1)
    return (
        f"offset of the tip: in {counted(len(tips), 'step')} with similar cables, the tip "
        f"is {distance:.1f} mm from where the first recording has it (median; {offset} mm "
        "in the base frame), with vibration and hysteresis"
    )


def _describe_episodes(imported: Imported | ImportedTake) -> list[str]:
    lengths = [len(episode) for episode in imported.episodes]
    shortest = min(lengths)
    longest = max(lengths)
    steps = str(longest)
    if shortest < longest:
        steps = f"{shortest} to {longest}"
    broken = ""
    read = imported.segments
    if read.broken_rows:
        broken = f"; {counted(read.broken_rows, 'unreadable row')} left as gaps"
    states = np.concatenate([each.sensor("states") for each in imported.episodes])
    known = np.isfinite(states)
    ends = []
    for module in range(states.shape[1]):
        position = known[:, module, :3].all(axis=-1).mean()
        axis = known[:, module, 3:].all(axis=-1).mean()
        if position:
            ends.append(
                f"end of module {module + 1} in {100 * position:.1f} % of steps, "
                f"its axis in {100 * axis:.1f} %"
            )
    lines = [
        f"{counted(len(lengths), 'episode')} of {steps} steps, "
        f"{sum(lengths)} in all, from {counted(read.rows, 'row')}{broken}",
        f"measured: {'; '.join(ends)}",
    ]
    for number, clocks in enumerate(read.clocks, 1):
        take = f"take {number}, " if len(read.clocks) > 1 else ""
        for file, clock in enumerate(clocks, 2):
            lines.append(f"clock of {take}file {file}: {clock}")
    if excluded := str(read.excluded):
        lines.append(excluded)
    rig = imported.rig
    rests = zip(rig.names, rig.rests, rig.scales, strict=False)
    known = [(name, rest / scale) for name, rest, scale in rests if rest]
    parts = [f"'{name}' {place:.4g}" for name, place in known]
    if parts:
        lines.append(
            f"rest: {', '.join(parts)}: their values where the arm is straightest; state "
            "the `offset` of a drive that you know"
        )
    return lines + [f"warning: {motion.text}" for motion in read.frame_motions]


def _vector(values: Iterable[float], digits: int = 4) -> str:
    return f"({', '.join(f'{value:.{digits}f}' for value in values)})"
