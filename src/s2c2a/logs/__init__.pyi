from .log_map import LogMap, load_map, map_from_toml
from .pipeline import (
    Imported,
    ImportedSession,
    arm_file_of,
    import_logs,
    import_session,
    save_imported,
)

__all__ = [
    "Imported",
    "ImportedSession",
    "LogMap",
    "arm_file_of",
    "import_logs",
    "import_session",
    "load_map",
    "map_from_toml",
    "save_imported",
]
