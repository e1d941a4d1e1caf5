from .log_map import (
    LogMap as LogMap,
)
from .log_map import (
    load_map as load_map,
)
from .log_map import (
    map_from_toml as map_from_toml,
)
from .pipeline import (
    Imported as Imported,
)
from .pipeline import (
    ImportedSession as ImportedSession,
)
from .pipeline import (
    arm_file_of as arm_file_of,
)
from .pipeline import (
    import_logs as import_logs,
)
from .pipeline import (
    import_session as import_session,
)
from .pipeline import (
    save_imported as save_imported,
)
