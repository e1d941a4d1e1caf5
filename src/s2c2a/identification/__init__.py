"""The simulated arm fitted to a recording: a twin of the arm that was recorded."""

from s2c2a.identification.fitting import Belief, Fit, FitOptions, identify
from s2c2a.identification.numbers import GROUPS, Kind, Unknown, unknowns_of
from s2c2a.identification.replay import Replay, replayed
from s2c2a.identification.report import TipErrors, fitted_toml, tip_errors
