"""MCAP files with Foxglove's schemas, and a layout that shows them."""

import json
from pathlib import Path
from typing import Any

from s2c2a.arm import arm_to_toml
from s2c2a.cli.export_table import import_map, table_of, units_of
from s2c2a.episodes import load_episodes
from s2c2a.errors import counted
from s2c2a.files.text import atomic_write, write_atomically
from s2c2a.integrations.exports.folders import write_map
from s2c2a.integrations.extras import needs_extra
from s2c2a.integrations.scenes import scenes_of

with needs_extra("foxglove", "the form mcap"):
    import foxglove

    from s2c2a.integrations.foxglove_scene import (
        NANOSECONDS,
        SCENE,
        STEP,
        WORLD,
        FoxgloveScene,
        step_name,
    )


def write_mcap(file: Path, out: Path) -> str:
    """Write a recording as MCAP, with a layout and the map that imports it again.

    Raises:
        S2C2AError: a file cannot be written.
    """
    episodes, options = load_episodes(file)
    arm = episodes[0].arm
    context = foxglove.Context()
    with (
        atomic_write(out) as part,
        foxglove.open_mcap(part, allow_overwrite=True, context=context) as writer,
    ):
        channels = FoxgloveScene(arm, context)
        for scene in scenes_of(episodes):
            channels.log(scene, round(scene.time * NANOSECONDS))
        source = {
            "arm": arm_to_toml(arm),
            "options": json.dumps(options, default=str),
            "units": json.dumps(units_of(episodes)),
        }
        writer.write_metadata("s2c2a", source)
    table = table_of(episodes)
    text = import_map(episodes, table, bool(options.get("at_rest")))
    names = {name: step_name(name) for name in table}
    write_map(text, names, Path(f"{out}.map.toml"), topic=STEP)
    layout = json.dumps(layout_of(arm.module_count), indent=2)
    write_atomically(layout, Path(f"{out}.layout.json"))
    return counted(len(episodes), "episode")


def layout_of(modules: int) -> dict[str, Any]:
    """A layout of Foxglove: the scene beside plots of the tip and of all cables."""
    tip = [f"{STEP}.sensor_states_{modules}_{axis}" for axis in "xyz"]
    goal = [f"{STEP}.desired_positions_{modules}_{axis}" for axis in "xyz"]
    return {
        "configById": {
            "3D!arm": {
                "followTf": WORLD,
                "topics": {SCENE: {"visible": True}},
                "transforms": {},
            },
            "Plot!tip": _plot("Tip [m]", [*tip, *goal]),
            "Plot!cables": _plot("Cables", ["/commands.joints[:].position"]),
        },
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": {
            "direction": "row",
            "first": "3D!arm",
            "second": {
                "direction": "column",
                "first": "Plot!tip",
                "second": "Plot!cables",
            },
        },
    }


def _plot(title: str, paths: list[str]) -> dict[str, Any]:
    series = [
        {"value": path, "enabled": True, "timestampMethod": "receiveTime"}
        for path in paths
    ]
    return {"foxglovePanelTitle": title, "paths": series, "xAxisVal": "timestamp"}
