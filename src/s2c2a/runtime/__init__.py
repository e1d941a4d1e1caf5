"""What drives a body: one loop with its clock, stages, limits and checks, for runs, recordings and the live page."""

from s2c2a.runtime.clock import Clock, StepClock, WallClock
from s2c2a.runtime.limits import CommandLimits
from s2c2a.runtime.loop import Driver, Loop
from s2c2a.runtime.record import Step, episode_of
from s2c2a.runtime.stages import Ask, Patience
