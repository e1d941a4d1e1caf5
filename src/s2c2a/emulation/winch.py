"""A servo with its pulley: conversion between ticks and displacements of a cable."""

from dataclasses import dataclass

import numpy as np

from s2c2a.emulation.plant import Plant
from s2c2a.emulation.servo import Drive, MotorState, Servo

GEAR_FRICTION = 0.012  # A of a motor that moves
CURRENT_NOISE = 0.002  # A
_MOVING = 1e-4  # m/s


@dataclass
class Winch:
    """One servo, its pulley and its cable.

    displacement = direction * (ticks - home_ticks) * tick_length

    Attributes:
        servo: the servo.
        original_id: of the servo, at power-up.
        cable: number of the cable, module by module.
        direction: 1 where a growing position pays the cable out, -1 where it winds in.
        home_ticks: position at displacement zero [ticks].
        tick_length: displacement of a tick [m].
        pulley_radius: [m].
    """

    servo: Servo
    original_id: int
    cable: int
    direction: int
    home_ticks: float
    tick_length: float
    pulley_radius: float

    @property
    def tension_per_current(self) -> float:
        """Tension of the cable per current [N/A]."""
        return self.servo.torque_constant / self.pulley_radius

    def set_targets(self, plant: Plant) -> None:
        """Pass the demands of the servo on to its motor."""
        command = self.servo.command()
        targets = plant.targets
        goal = command.goal
        if command.drive is Drive.POSITION:
            goal = self.direction * (command.goal - self.home_ticks) * self.tick_length
        if command.drive is Drive.VELOCITY:
            goal = self.direction * command.goal * self.pulley_radius
        if command.drive is Drive.CURRENT:
            goal = -self.direction * command.goal * self.tension_per_current
        targets.torque[self.cable] = command.torque
        targets.drive[self.cable] = command.drive
        targets.goal[self.cable] = goal
        targets.speed[self.cable] = command.speed * self.pulley_radius
        targets.tension[self.cable] = command.current * self.tension_per_current

    def measure(
        self, plant: Plant, voltage: float, random: np.random.Generator
    ) -> MotorState:
        """Return what the servo measures.

        Args:
            plant: the motors and cables.
            voltage: of the supply [V].
            random: of the noise.
        """
        ticks = self.ticks(plant.positions[self.cable])
        speed = plant.velocities[self.cable]
        # The motor holds against the cable: it drives towards winding in.
        current = 0.0
        if plant.targets.torque[self.cable]:
            current = -plant.tensions[self.cable] / self.tension_per_current
            current += GEAR_FRICTION * np.sign(speed) * (abs(speed) > _MOVING)
            current += random.normal(scale=CURRENT_NOISE)
        noise = random.normal(scale=plant.arm.motor.noise_ticks)
        return MotorState(
            ticks=float(ticks + noise),
            velocity=float(self.direction * speed / self.pulley_radius),
            current=float(self.direction * current),
            voltage=voltage,
        )

    def ticks(self, displacement: float) -> float:
        """Return the position [ticks] at a displacement [m]."""
        return self.home_ticks + self.direction * displacement / self.tick_length
