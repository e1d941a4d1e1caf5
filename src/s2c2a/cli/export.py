"""Command `s2c2a export`: episodes as NPZ or MAT, for other programs."""

import json
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro

from s2c2a.arm import arm_to_toml
from s2c2a.episodes import load_episodes
from s2c2a.errors import S2C2AError
from s2c2a.files import atomic_write

RecordingFile = tyro.conf.Positional[Annotated[Path, tyro.conf.arg(metavar="FILE")]]
ENDINGS = ".npz", ".mat"


def export(recording: RecordingFile, out: Path) -> None:
    """Write the episodes of a recording or run as NPZ or MAT (docs/reference/episodes.md).

    Every column of every episode becomes an array, such as episode1.sensor_cables. The
    arm file and the options become text.

    Args:
        recording: the episodes, such as mine.episodes.
        out: the file, ending in .npz or .mat; replaced if it exists.
    """
    if out.suffix not in ENDINGS:
        raise S2C2AError(f"--out '{out}' ends in none of {', '.join(ENDINGS)}")
    episodes, options = load_episodes(recording)
    content: dict[str, Any] = {
        "arm": arm_to_toml(episodes[0].arm),
        "options": json.dumps(options),
    }
    for number, episode in enumerate(episodes, 1):
        # MATLAB allows no point in a name
        columns: dict[str, Any] = {
            name.replace(".", "_"): values for name, values in episode.columns.items()
        }
        columns["options"] = json.dumps(dict(episode.options))
        content[f"episode{number}"] = columns
    with atomic_write(out) as part, open(part, "wb") as file:
        if out.suffix == ".npz":
            np.savez_compressed(file, **_flat(content))
        else:
            from scipy.io import savemat

            savemat(file, content, long_field_names=True, do_compression=True)
    print(f"{len(episodes)} episodes: {out}")


def _flat(content: dict[str, Any]) -> dict[str, Any]:
    """Arrays of episodes by prefix, such as `episode1.time`."""
    flat: dict[str, Any] = {}
    for name, value in content.items():
        if isinstance(value, dict):
            flat |= {f"{name}.{column}": array for column, array in value.items()}
        else:
            flat[name] = value
    return flat
