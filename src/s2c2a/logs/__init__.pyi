from .log_map import LogMap, load_map, map_from_toml
from .pipeline import (
    Imported,
    ImportedTake,
    arm_file_of,
    import_logs,
    import_take,
    save_imported,
)

__all__ = [
    "Imported",
    "ImportedTake",
    "LogMap",
    "arm_file_of",
    "import_logs",
    "import_take",
    "load_map",
    "map_from_toml",
    "save_imported",
]
