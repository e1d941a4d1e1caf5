"""System identification: fit of a simulated arm to a recording of an arm."""

from s2c2a.logs.identification.fitting import Fit, Posterior, identify
from s2c2a.logs.identification.numbers import (
    GROUPS,
    USUAL,
    Unknown,
    arm_at,
    unknowns_of,
    with_default_starts,
)
from s2c2a.logs.identification.problem import FitOptions, Problem, held_out, options_for
from s2c2a.logs.identification.replay import Replay, replayed, thinned
from s2c2a.logs.identification.report import (
    FittedNumber,
    TipErrors,
    errors_of,
    fitted_numbers,
    fitted_toml,
    tip_errors,
    undetermined_combinations,
)
