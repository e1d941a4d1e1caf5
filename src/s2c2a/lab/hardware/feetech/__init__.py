"""Feetech STS servos on a serial bus."""

from s2c2a.lab.hardware.feetech.bus import FeetechBus
