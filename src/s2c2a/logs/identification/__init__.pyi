from .fitting import Fit, Posterior, identify
from .numbers import GROUPS, USUAL, Unknown, arm_at, unknowns_of, with_default_starts
from .problem import FitProblem, IdentificationOptions, held_out, options_for
from .replay import Replay, replayed, thinned
from .report import (
    FittedNumber,
    TipErrors,
    errors_of,
    fitted_numbers,
    fitted_toml,
    tip_errors,
    undetermined_combinations,
)

__all__ = [
    "GROUPS",
    "USUAL",
    "Fit",
    "FitProblem",
    "FittedNumber",
    "IdentificationOptions",
    "Posterior",
    "Replay",
    "TipErrors",
    "Unknown",
    "arm_at",
    "errors_of",
    "fitted_numbers",
    "fitted_toml",
    "held_out",
    "identify",
    "options_for",
    "replayed",
    "thinned",
    "tip_errors",
    "undetermined_combinations",
    "unknowns_of",
    "with_default_starts",
]
