"""DYNAMIXEL servos: protocol 2.0, control tables, and the bus."""

from s2c2a.lab.hardware.dynamixel.bus import DynamixelBus
