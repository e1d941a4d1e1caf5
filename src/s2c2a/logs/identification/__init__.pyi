from .fitting import (
    Fit as Fit,
)
from .fitting import (
    Posterior as Posterior,
)
from .fitting import (
    identify as identify,
)
from .numbers import (
    GROUPS as GROUPS,
)
from .numbers import (
    USUAL as USUAL,
)
from .numbers import (
    Unknown as Unknown,
)
from .numbers import (
    arm_at as arm_at,
)
from .numbers import (
    unknowns_of as unknowns_of,
)
from .numbers import (
    with_default_starts as with_default_starts,
)
from .problem import (
    FitOptions as FitOptions,
)
from .problem import (
    Problem as Problem,
)
from .problem import (
    held_out as held_out,
)
from .problem import (
    options_for as options_for,
)
from .replay import (
    Replay as Replay,
)
from .replay import (
    replayed as replayed,
)
from .replay import (
    thinned as thinned,
)
from .report import (
    FittedNumber as FittedNumber,
)
from .report import (
    TipErrors as TipErrors,
)
from .report import (
    errors_of as errors_of,
)
from .report import (
    fitted_numbers as fitted_numbers,
)
from .report import (
    fitted_toml as fitted_toml,
)
from .report import (
    tip_errors as tip_errors,
)
from .report import (
    undetermined_combinations as undetermined_combinations,
)
