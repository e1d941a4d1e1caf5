"""A servo with its pulley: conversion between ticks and displacements of a cable."""

import math
from dataclasses import dataclass

import numpy as np

from s2c2a.lab.emulation.plant import Plant
from s2c2a.lab.emulation.servo import MotorState, Servo

GEAR_FRICTION = 0.012  # A of a motor that moves
CURRENT_NOISE = 0.002  # A
_MOVING = 1e-4  # m/s


@dataclass(frozen=True)
class Pulley:
    """A pulley on which the cable may pile up.

    The length wound on by n turns from home is 2 pi (r n + g n^2 / 2), with the radius
    r at home and its growth g with every turn.

    Attributes:
        radius: at home [m].
        growth: of the radius with every turn wound on [m].
    """

    radius: float
    growth: float = 0.0

    def length(self, turns: float) -> float:
        """Return the length [m] wound on by turns from home."""
        even = self.radius * turns
        growing = self.growth * turns**2 / 2
        return 2 * math.pi * (even + growing)

    def turns(self, length: float) -> float:
        """Return the turns from home that wind on a length [m]."""
        if not self.growth:
            return length / (2 * math.pi * self.radius)
        square = self.radius**2 + self.growth * length / math.pi
        return (math.sqrt(max(square, 0.0)) - self.radius) / self.growth

    def radius_at(self, length: float) -> float:
        """Return the radius [m] with a length [m] wound on from home."""
        return self.radius + self.growth * self.turns(length)


@dataclass
class Winch:
    """One servo, its pulley and its cable.

    Without growth of the pulley,
    displacement = direction * (ticks - home_ticks) * 2 pi radius / ticks_per_turn.

    Attributes:
        servo: the servo.
        original_id: of the servo, at power-up.
        cable: number of the cable, module by module.
        direction: 1 where a growing position pays the cable out, -1 where it winds in.
        pulley: of the cable.
        home_ticks: position at displacement zero [ticks].
    """

    servo: Servo
    original_id: int
    cable: int
    direction: int
    pulley: Pulley
    home_ticks: float = 0.0

    def ticks(self, displacement: float) -> float:
        """Return the position [ticks] at a displacement [m]."""
        turns = -self.direction * self.pulley.turns(-displacement)
        return self.home_ticks + turns * self.servo.ticks_per_turn

    def displacement(self, ticks: float) -> float:
        """Return the displacement [m] at a position [ticks]."""
        turns = (ticks - self.home_ticks) / self.servo.ticks_per_turn
        return -self.pulley.length(-self.direction * turns)

    def set_targets(self, plant: Plant) -> None:
        """Pass the demands of the servo on to its motor."""
        command = self.servo.command()
        targets = plant.targets
        radius = self.pulley.radius_at(-plant.positions[self.cable])
        tension_per_current = self.servo.torque_constant / radius
        targets.torque[self.cable] = command.torque
        targets.goal[self.cable] = self.displacement(command.goal)
        targets.speed[self.cable] = command.speed * radius
        targets.tension[self.cable] = command.current * tension_per_current

    def measure(
        self, plant: Plant, voltage: float, random: np.random.Generator
    ) -> MotorState:
        """Return what the servo measures.

        Args:
            plant: the motors and cables.
            voltage: of the supply [V].
            random: of the noise.
        """
        position = plant.positions[self.cable]
        speed = plant.velocities[self.cable]
        radius = self.pulley.radius_at(-position)
        # The motor holds against the cable: it drives towards winding in.
        current = 0.0
        if plant.targets.torque[self.cable]:
            torque = -plant.tensions[self.cable] * radius
            current = torque / self.servo.torque_constant
            current += GEAR_FRICTION * np.sign(speed) * (abs(speed) > _MOVING)
            current += random.normal(scale=CURRENT_NOISE)
        noise = random.normal(scale=plant.arm.motor.noise_ticks)
        return MotorState(
            ticks=float(self.ticks(position) + noise),
            velocity=float(self.direction * speed / radius),
            current=float(self.direction * current),
            voltage=voltage,
        )
