"""Runtime of a robot: the control loop with its clock, stages, limits, and checks.

Runs, recordings, and the live page all drive arms through `Loop`.
"""

from s2c2a.runtime.clock import Clock, StepClock, WallClock
from s2c2a.runtime.conformance import check_robot
from s2c2a.runtime.driver import Driver
from s2c2a.runtime.emergency import (
    EMERGENCY_STOP,
    EmergencyStop,
    EmergencyStopError,
    stop_on_signal,
)
from s2c2a.runtime.limits import CommandLimits
from s2c2a.runtime.loop import Loop
from s2c2a.runtime.player import Player, play
from s2c2a.runtime.record import StepRecord, build_episode
from s2c2a.runtime.stages import Patience, StepRequest
