"""Logs of other people's arms: from their files, told by a map, to a recording and an arm file."""

from s2c2a.logs.importing import (
    Again,
    Imported,
    arm_file_of,
    import_again,
    import_logs,
    save_imported,
)
from s2c2a.logs.map import LogMap, load_map, map_from_toml
