"""Episodes as one table with a column for each number, and the map that imports it."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import tomli_w
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.arm.geometry import per_module
from s2c2a.episodes import Episode

EPISODE = "episode"
LOG_TIME = "log_time"
UNITS = {
    "time": "s",
    LOG_TIME: "s",
    "tick_time": "s",
    "payload": "kg",
    "bend_biases": "rad",
    "external_force": "N",
    "predicted": "m; axes 1",
    "sensor.states": "m; axes 1",
    "predictive_std": "m",
    "extrapolation": "m",
    "plan_error": "m",
    "horizon": "m",
    "target_offsets": "m",
    "desired_positions": "m",
    "obstacles": "m",
}
"""Units of columns; the others have none, or that of their sensor."""

COORDINATES = {
    "predicted",
    "sensor.states",
    "horizon",
    "target_offsets",
    "desired_positions",
    "desired_axes",
}
"""Columns of positions and axes; others of three values count modules or cables."""

Columns = dict[str, Float[np.ndarray, " rows"]]


def table_of(episodes: Sequence[Episode]) -> Columns:
    """Columns of all episodes, one below the other; NaN where an episode has none.

    Indices in names count from 1: `actions.2.3` is of cable 3 of module 2.
    `sensor.states.2.x` and `sensor.states.2.axis_x` are of the end of module 2.
    `log_time` goes on from episode to episode.
    """
    parts = [_flat(episode) for episode in episodes]
    names = list(dict.fromkeys(name for part in parts for name in part))
    start = 0.0
    for number, (part, episode) in enumerate(zip(parts, episodes, strict=True), 1):
        time = episode["time"]
        part[EPISODE] = np.full(len(time), float(number))
        part[LOG_TIME] = start + time - time[0]
        start = part[LOG_TIME][-1] + episode.arm.control_period
    return {
        name: np.concatenate(
            [part.get(name, np.full(len(part["time"]), np.nan)) for part in parts]
        )
        for name in (EPISODE, LOG_TIME, *names)
    }


def units_of(episodes: Sequence[Episode]) -> dict[str, str]:
    """Units by column of an episode."""
    unit = episodes[0].arm.unit
    known = UNITS | {"actions": unit, "sensor.cables": unit}
    names = {LOG_TIME, *(name for episode in episodes for name in episode.columns)}
    return {name: unit for name, unit in known.items() if name in names}


def import_map(episodes: Sequence[Episode], table: Columns, at_rest: bool) -> str:
    """Text of the map with which `s2c2a import` reads the table.

    It is empty without ends.
    """
    arm = episodes[0].arm
    ends = _ends(arm, table)
    if not ends:
        return ""
    # of most keys, a map states one number for all modules
    known: dict[str, Any] = {
        "name": arm.name,
        "modules": arm.module_count,
        "control_rate": arm.control_rate,
        "lengths": per_module(arm, "length").tolist(),
        "gravity_direction": list(arm.gravity_direction),
        "coupled_cables": arm.coupled_cables,
    }
    for key in ("cable_radius", "mass", "bending_stiffness", "bend_limit_deg"):
        values = per_module(arm, key)
        if (values == values[0]).all():
            known[key] = float(values[0])
    content = {
        "rows": {
            "kind": "steps" if at_rest else "timed",
            "time": LOG_TIME,
            "label": EPISODE,
            "commands": "sent",
        },
        "arm": known,
        "frame": {"along": "z", "x": "x", "base": [0.0, 0.0, 0.0]},
        "drives": _drives(arm, table),
        "ends": ends,
    }
    return tomli_w.dumps(content)


def _flat(episode: Episode) -> Columns:
    flat: Columns = {}
    for name, values in episode.columns.items():
        for index in np.ndindex(values.shape[1:]):
            places = [str(place + 1) for place in index]
            if places:
                places[-1] = _place(values.shape[-1], name, index[-1])
            flat[".".join([name, *places])] = values[:, *index].astype(float)
    return flat


def _place(size: int, name: str, place: int) -> str:
    """Name of a coordinate, or the number of what has none."""
    if size in (3, 6) and name in COORDINATES:
        axes = ("x", "y", "z", "axis_x", "axis_y", "axis_z")
        return axes[place]
    return str(place + 1)


def _drives(arm: ArmSpec, table: Columns) -> list[dict[str, Any]]:
    positive = "pulls" if arm.actuation == "tension" else "releases"
    drives = []
    for number, module in enumerate(arm.modules):
        for cable, angle in enumerate(module.cable_angles_deg):
            place = f".{number + 1}.{cable + 1}"
            drive = {
                "commanded": f"actions{place}",
                "unit": arm.unit,
                "positive": positive,
                "module": number,
                "angle_deg": float(angle),
            }
            if _is_known(table, measured := f"sensor.cables{place}"):
                drive["measured"] = measured
            drives.append(drive)
    return drives


def _ends(arm: ArmSpec, table: Columns) -> list[dict[str, Any]]:
    ends = []
    for module in range(arm.module_count):
        prefix = f"sensor.states.{module + 1}."
        end: dict[str, Any] = {"module": module, "unit": "m"}
        end["position"] = [f"{prefix}{axis}" for axis in "xyz"]
        axis = [f"{prefix}axis_{axis}" for axis in "xyz"]
        if _is_known(table, axis[0]):
            end["axis"] = axis
        if _is_known(table, end["position"][0]):
            ends.append(end)
    return ends


def _is_known(table: Mapping[str, np.ndarray], name: str) -> bool:
    return name in table and bool(np.isfinite(table[name]).any())
