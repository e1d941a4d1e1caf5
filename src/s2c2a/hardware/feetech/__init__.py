"""Feetech STS servos on a serial bus."""

from s2c2a.hardware.feetech.bus import FeetechBus
