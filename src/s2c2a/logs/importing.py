"""From logs and a map to a recording and an arm."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec, arm_from_toml, arm_to_toml
from s2c2a.data import Recording
from s2c2a.episodes import Episode, save_episodes
from s2c2a.files import save_whole
from s2c2a.logs.cables import STIFFNESS, Motors, found_cables, thinned
from s2c2a.logs.errors import LogError
from s2c2a.logs.fitting import Fit, Seen, predicted_states
from s2c2a.logs.found_arm import Layout, arm_text, layout_of, matched
from s2c2a.logs.frames import Registration, first_registration
from s2c2a.logs.map import LogMap
from s2c2a.logs.resampling import stretches
from s2c2a.logs.resampling import told as commands_of
from s2c2a.logs.rig import KEY, Nearby, Rig, check_arm, in_frame, nearby
from s2c2a.logs.session import Session, session_of
from s2c2a.logs.tables import Asked, read_table
from s2c2a.logs.tendons import Guess, turned
from s2c2a.spaces import POSITION

MAX_FITTED = 200  # rows that the fit takes, evenly spread
FREE = 3.0
# times the arm's length from its base: not even where a camera was moved
FURTHEST = 10.0


@dataclass(frozen=True)
class Imported:
    """What came of logs.

    Attributes:
        arm: that was found, or was stated.
        text: of its arm file, with what is uncertain beside each number.
        episodes: in the base frame.
        rig: how cameras and motors stand to it.
        layout: where each drive went.
        fit: of the model that frame and cables were found with.
        motors: what that assumes.
        residual: rms distance of the model's ends from those seen [m].
        at_rest: whether every row is a shape at rest.
        doubts: what could not be told apart.
        broken: rows that could not be read.
        rows: that were read.
    """

    arm: ArmSpec
    text: str
    episodes: tuple[Episode, ...]
    rig: Rig
    layout: Layout
    fit: Fit
    motors: Motors
    residual: float
    at_rest: bool
    doubts: tuple[str, ...]
    broken: int
    rows: int


def import_logs(
    paths: Sequence[str | os.PathLike], told: LogMap, arm: ArmSpec | None = None
) -> Imported:
    """Read logs and find frame and cables.

    Args:
        paths: files; each is a session, or as many as the map joins are.
        told: the map.
        arm: take this one in place of the one that is found; its cables are matched
            with those found.

    Raises:
        LogError: a file cannot be used, or says too little, or the map does not tell of
            the arm.
    """
    if arm is not None:
        check_arm(arm, told)
    parts, rows, broken = _parts(paths, told)
    seen, frame = _seen(parts, told)
    fit, motors, doubts = found_cables(
        seen, thinned(seen, MAX_FITTED), _start(frame, told), told
    )
    layout = layout_of(fit, motors, told)
    bends, states = predicted_states(fit.guess, fit.wiring, seen.columns, seen.tension)
    base = np.asarray(fit.guess.base)
    axes = (seen.frame @ np.asarray(turned(fit.guess.tilt))).T
    apart = (states - in_frame(seen.states, base, axes))[..., POSITION]
    residual = float(np.sqrt(np.nanmean(np.sum(apart**2, axis=-1))))
    text = arm_text(fit, motors, layout, told, _by_part(bends, parts), residual)
    if arm is None:
        arm = arm_from_toml(text, "the arm that was found")
    else:
        text = arm_to_toml(arm)
        layout = matched(layout, arm, turned=told.frame.x is None)
    rig = Rig.found(told, layout.drive, layout.factor, base, _turn(layout.turn) @ axes)
    episodes = _episodes(parts, seen.states, arm, rig, told)
    return Imported(
        arm,
        text,
        episodes,
        rig,
        layout,
        fit,
        motors,
        residual,
        _at_rest(told),
        tuple(doubts),
        broken,
        rows,
    )


@dataclass(frozen=True)
class Again:
    """Another session of an arm whose logs were imported before.

    Attributes:
        episodes: in its base frame.
        rig: of the first session.
        nearby: the rows whose cables stood most as they did then.
        at_rest: whether every row is a shape at rest.
        broken: rows that could not be read.
        rows: that were read.
    """

    episodes: tuple[Episode, ...]
    rig: Rig
    nearby: Nearby
    at_rest: bool
    broken: int
    rows: int


def import_again(
    paths: Sequence[str | os.PathLike], told: LogMap, first: Recording
) -> Again:
    """Read logs of another session: cameras and motors stand as an earlier import found them.

    Args:
        paths: files; each is a session, or as many as the map joins are.
        told: the map, with the same drives.
        first: the recording that the earlier import made.

    Raises:
        LogError: a file cannot be used, the recording was made of no log, or the map
            tells of another arm.
    """
    rig = Rig.of(first, told)
    parts, rows, broken = _parts(paths, told)
    episodes = _episodes(parts, _measured(parts, told), first.arm, rig, told)
    _check_reach(episodes, first.arm)
    now, then = (
        [
            np.concatenate([one.sensor(name) for one in some])
            for name in ("cables", "states")
        ]
        for some in (episodes, first.episodes)
    )
    near = nearby(now[0], now[1][:, -1, POSITION], then[0], then[1][:, -1, POSITION])
    return Again(episodes, rig, near, _at_rest(told), broken, rows)


def _check_reach(episodes: Sequence[Episode], arm: ArmSpec) -> None:
    far = max(
        float(np.nanmax(np.abs(one.sensor("states")[..., POSITION]), initial=0.0))
        for one in episodes
    )
    if far > FURTHEST * arm.length:
        raise LogError(
            f"ends are up to {far:.3g} m from the base of an arm of {arm.length:.3g} m, in the frame of the first "
            "recording; let the map say their unit, or, where cameras stand elsewhere now, import it without --like"
        )


def _parts(
    paths: Sequence[str | os.PathLike], told: LogMap
) -> tuple[list[Session], int, int]:
    """Stretches without a gap; rows that were read; and those of them that could not be."""
    sessions = _sessions(paths, told)
    parts = [
        part
        for session in sessions
        for part in stretches(session, told.rows, 1 / told.arm.control_rate)
    ]
    if not parts:
        raise LogError(
            f"nothing is left: no {told.rows.shortest} steps follow each other; see rows.longest_gap and rows.label"
        )
    return parts, sum(map(len, sessions)), sum(one.broken for one in sessions)


def _at_rest(told: LogMap) -> bool:
    return told.rows.kind == "steps"


def _turn(angle: float) -> np.ndarray:
    cos = np.cos(angle)
    sin = np.sin(angle)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])


def save_imported(
    imported: Imported | Again, path: str | os.PathLike, options: dict[str, Any]
) -> Path | None:
    """Write the recording, and an arm that was found beside it; says where that is.

    Raises:
        S2C2AError: one of them cannot be written.
    """
    said = {
        "babbling": "imported log",
        "body": "a log",
        "episodes": len(imported.episodes),
    }
    said |= {"at_rest": imported.at_rest, KEY: imported.rig.model_dump()}
    if isinstance(imported, Again):
        save_episodes(imported.episodes, path, options | said)
        return None
    save_episodes(
        imported.episodes,
        path,
        options | said | {"residual_mm": round(1e3 * imported.residual, 2)},
    )
    return save_whole(imported.text, arm_file_of(path), LogError)


def arm_file_of(path: str | os.PathLike) -> Path:
    """Where the arm file of a recording stands."""
    return Path(path).with_suffix(".arm.toml")


def _sessions(paths: Sequence[str | os.PathLike], told: LogMap) -> list[Session]:
    each = told.join.files if told.join else 1
    if not paths or len(paths) % each:
        raise LogError(
            f"{len(paths)} files; the map joins {each} to a session, so give a multiple of that"
        )
    asked = Asked(
        told.numbers, told.words, told.rows.skip_lines, told.rows.broken_rows == "gap"
    )
    tables = [read_table(path, asked) for path in paths]
    return [
        session_of(tables[begin : begin + each], told)
        for begin in range(0, len(tables), each)
    ]


def _measured(parts: Sequence[Session], told: LogMap) -> np.ndarray:
    """States in the log's frame, NaN where nothing was seen, shape (rows, modules, 6)."""
    ends = np.concatenate(
        [np.concatenate([part.positions, part.axes], axis=-1) for part in parts]
    )
    states = np.full((len(ends), told.arm.modules, 6), np.nan)
    states[:, told.end_modules] = ends
    return states


def _check_drives(
    columns: Float[np.ndarray, "rows drives"], length: float, told: LogMap
) -> None:
    """Refuse a drive that winds more cable than the arm is long: its unit is another."""
    moved = np.nanmax(columns, axis=0) - np.nanmin(columns, axis=0)
    for drive, way in zip(told.drives, moved, strict=True):
        if drive.unit not in ("free", "N") and way > length:
            raise LogError(
                f"'{drive.name}' moves by {way:.3g} m, and the arm is {length:.3g} m long; let the map say its unit"
            )


def _seen(parts: Sequence[Session], told: LogMap) -> tuple[Seen, Registration]:
    columns = np.concatenate([_in_effect(part, told) for part in parts])
    states = _measured(parts, told)
    positions = np.concatenate([part.positions for part in parts])
    frame = first_registration(positions, told)
    length = float(frame.lengths.sum())
    _check_drives(columns, length, told)
    return Seen(
        columns, states, frame.axes, told.drives[0].unit == "N", _spread(told), length
    ), frame


def _in_effect(part: Session, told: LogMap) -> np.ndarray:
    """What the drives held while the row was measured."""
    commands = commands_of(part)
    if not settled(told):
        commands = np.concatenate([commands[:1], commands[:-1]])
    return np.where(np.isfinite(part.measured), part.measured, commands)


def settled(told: LogMap) -> bool:
    """Whether a row was measured after its command."""
    return (
        told.rows.commands or ("settled" if told.rows.kind == "steps" else "sent")
    ) == "settled"


def _spread(told: LogMap) -> dict[str, float]:
    """How far numbers may be from what is known of them."""
    each = told.arm.lengths is not None
    total = told.arm.length is not None
    return {
        "angles": 2.0,
        "gain": 3.0,
        "gains": 0.3 if told.drives[0].unit == "free" else 0.1,
        "offsets": 0.1,
        "lengths": 0.002 if each else 0.2,
        "total": 0.002 if total else 0.2,
        "stiffness": 2.0,
        "gravity": 0.3 if any(told.arm.gravity_direction) else 1e-6,
        "tilt": 0.1,
        "base": 0.002 if told.frame.base is not None else 0.1,
    }


def _start(frame: Registration, told: LogMap) -> Guess:
    nothing = np.zeros(len(told.drives))
    return Guess(
        nothing,
        np.array(0.0),
        nothing,
        nothing,
        np.log(frame.lengths),
        np.array(np.log(STIFFNESS)),
        np.array(0.0),
        np.zeros(2),
        frame.base,
    )


def _episodes(
    parts: Sequence[Session], states: np.ndarray, arm: ArmSpec, rig: Rig, told: LogMap
) -> tuple[Episode, ...]:
    own = _by_part(rig.in_base(states), parts)
    return tuple(
        _episode(part, each, arm, rig, told)
        for part, each in zip(parts, own, strict=True)
    )


def _by_part(rows: np.ndarray, parts: Sequence[Session]) -> list[np.ndarray]:
    return np.split(rows, np.cumsum([len(part) for part in parts])[:-1])


def _episode(
    part: Session, states: np.ndarray, arm: ArmSpec, rig: Rig, told: LogMap
) -> Episode:
    """What was sent at a step is what is in effect at the next one where rows were measured after their command."""
    commands = commands_of(part)
    sent = np.concatenate([commands[1:], commands[-1:]]) if settled(told) else commands
    columns = {
        "time": part.time - part.time[0],
        "actions": rig.cables(sent),
        "sensor.cables": rig.cables(_in_effect(part, told)),
        "sensor.states": states,
    }
    label = str(part.labels[0])
    return Episode(arm, columns, {"label": label} if label else {})
