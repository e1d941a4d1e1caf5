"""Recordings of Rerun."""

from pathlib import Path

from s2c2a.arm import arm_to_toml
from s2c2a.cli.export_table import table_of
from s2c2a.episodes import load_episodes
from s2c2a.files.text import atomic_write
from s2c2a.integrations.extras import needs_extra
from s2c2a.integrations.rerun_scene import RerunScene, save_to
from s2c2a.integrations.scenes import scenes_of


def write_rrd(file: Path, out: Path) -> str:
    """Write a recording for Rerun.

    Raises:
        S2C2AError: the extra `rerun` is missing, or the file cannot be written.
    """
    with needs_extra("rerun", "the form rrd"):
        import rerun  # noqa: PLC0415  # an extra
    episodes, _ = load_episodes(file)
    arm = episodes[0].arm
    with atomic_write(out) as part:
        with rerun.RecordingStream("s2c2a", recording_id=file.stem) as stream:
            save_to(stream, part)
            stream.log("arm_file", rerun.TextDocument(arm_to_toml(arm)), static=True)
            entities = RerunScene(arm, stream)
            entities.log_numbers(table_of(episodes))
            for scene in scenes_of(episodes):
                entities.log(scene)
            stream.flush()
        stream.disconnect()
    return f"{len(episodes)} episodes"
