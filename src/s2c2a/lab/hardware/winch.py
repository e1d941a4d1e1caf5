"""Winches: servo positions and cable displacements."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from s2c2a.arm import ArmSpec, Servos, servos_of
from s2c2a.arm.geometry import cables_present, per_cable, per_module
from s2c2a.errors import RobotError
from s2c2a.lab.hardware.bus import BusError, ServoBus
from s2c2a.runtime.limits import command_range
from s2c2a.spaces import Actions

Ticks = Int[np.ndarray, "modules cables"]
Cables = Float[np.ndarray, "modules cables"]

NO_SERVO = -1
MARGIN = 0.25  # of the range, beyond the limits; more shows a wrong calibration


def servo_ids(arm: ArmSpec) -> Ticks:
    """Return the servo of every cable, shape (modules, cables).

    It is `NO_SERVO` in the columns beyond the cables of a module.
    """
    present = cables_present(arm)
    ids = np.full(present.shape, NO_SERVO)
    ids[present] = [id for row in servos_of(arm).ids for id in row]
    return ids


def check_ticks(arm: ArmSpec, bus: ServoBus) -> None:
    """Check that the arm file counts the ticks of a turn as the servos do.

    Raises:
        BusError: it does not; every motion would be wrong by their ratio.
    """
    if arm.motor.ticks_per_turn != bus.ticks_per_turn:
        raise BusError(
            f"motor.ticks_per_turn of '{arm.name}' is {arm.motor.ticks_per_turn}; its "
            f"servos have {bus.ticks_per_turn}. Correct the arm file"
        )


def check_plausible(displacements: Actions, arm: ArmSpec) -> None:
    """Check that the cables of an arm that begins to move can be where they seem to be.

    Args:
        displacements: measured [m], shape (modules, cables).
        arm: with its range.

    Raises:
        RobotError: a cable is further out of its range than `MARGIN`.
    """
    low, high = command_range(arm)
    room = MARGIN * (high - low)
    outside = (displacements < low - room) | (displacements > high + room)
    if outside.any():
        ids = servo_ids(arm)[outside].tolist()
        places = 1000 * displacements[outside]
        raise RobotError(
            f"the cables of servos {ids} stand at {places.round(1).tolist()} mm, "
            "out of their range; the calibration no longer fits. Home the arm "
            "again (`s2c2a motors home --overwrite`)"
        )


def torque_constants(arm: ArmSpec, bus: ServoBus) -> Cables:
    """Return the torque per current of every servo [N m/A], one without a cable."""
    ids = servo_ids(arm)
    servos = servos_of(arm)
    constants = np.ones(ids.shape)
    for id in ids[ids != NO_SERVO].tolist():
        known = servos.of(id).torque_constant
        constants[ids == id] = known or bus.torque_constant_of(id)
    return constants


def servo_values(arm: ArmSpec, value: Callable[[Servos], float]) -> Cables:
    """Return a value of the servo of every cable; zero without a cable."""
    ids = servo_ids(arm)
    servos = servos_of(arm)
    values = np.zeros(ids.shape)
    for id in ids[ids != NO_SERVO].tolist():
        values[ids == id] = value(servos.of(id))
    return values


def taut_windings(arm: ArmSpec, torque_constants: Cables) -> Actions:
    """Return the lengths that homing winds in from rest to taut cables [m].

    They take up the backlash and stretch the cables by the home current.

    Args:
        arm: with its servos, or their defaults.
        torque_constants: of the servos [N m/A], shape (modules, cables).
    """
    currents = servo_values(arm, lambda servos: servos.home_current)
    tension = currents * torque_constants / arm.motor.pulley_radius
    stiffness = per_module(arm, "cable.stiffness")[:, None]
    windings = tension / stiffness + per_cable(arm, "cable.backlash")
    return windings * cables_present(arm)


@dataclass(frozen=True)
class Winches:
    """Pulleys that wind the cables of an arm, one on each servo.

    A pulley that has wound n turns since home has taken in 2 pi (r n + g n^2 / 2) of
    cable, where r is its radius and g the growth of the radius with every turn.

    Attributes:
        home: servo positions of the straight arm [ticks], shape (modules, cables).
        directions: 1 where a growing position pays the cable out, -1 where it winds it
            in, shape (modules, cables).
        radius: of the pulleys [m].
        ticks_per_turn: of the servo positions.
        layer_growth: growth of the radius with every turn wound on [m].
    """

    home: Ticks
    directions: Ticks
    radius: float
    ticks_per_turn: int
    layer_growth: float = 0.0

    @classmethod
    def of(cls, arm: ArmSpec, home: Ticks) -> "Winches":
        """Return the winches of an arm with homes [ticks], shape (modules, cables)."""
        servos = servos_of(arm)
        directions = np.ones(home.shape, int)
        if servos.directions is not None:
            rows = [one for row in servos.directions for one in row]
            directions[cables_present(arm)] = rows
        return cls(
            home,
            directions,
            arm.motor.pulley_radius,
            arm.motor.ticks_per_turn,
            servos.layer_growth,
        )

    def displacements(self, positions: Ticks) -> Actions:
        """Return cable displacements [m], positive where a cable is paid out."""
        turns = self.directions * (positions - self.home) / self.ticks_per_turn
        # n turns wound in are -n turns paid out
        return (
            2 * np.pi * (self.radius * turns - 0.5 * self.layer_growth * turns * turns)
        )

    def positions(self, displacements: Actions) -> Ticks:
        """Return servo positions [ticks] of cable displacements [m]."""
        lengths = displacements / (2 * np.pi)
        turns = lengths / self.radius
        if self.layer_growth:
            # root of r n - g n^2 / 2 = length that goes to length / r for small g
            root = self.radius**2 - 2 * self.layer_growth * lengths
            outer = np.sqrt(np.maximum(root, 0.0))
            turns = 2 * lengths / (self.radius + outer)
        ticks = self.directions * turns * self.ticks_per_turn
        return self.home + np.round(ticks).astype(int)

    def tensions(self, currents: Cables, torque_constants: Cables | float) -> Cables:
        """Return cable tensions [N] of motor currents.

        Args:
            currents: [A], positive where they drive the position up.
            torque_constants: torque per current [N m/A].
        """
        return -self.directions * currents * torque_constants / self.radius

    def in_same_turn(self, positions: Ticks) -> "Winches":
        """Return winches with homes moved by whole turns, closest to positions.

        Servos forget whole turns without power. If the range of a cable is smaller
        than a turn, its position tells the turn.

        Args:
            positions: present servo positions [ticks], shape (modules, cables).
        """
        turns = np.round((positions - self.home) / self.ticks_per_turn).astype(int)
        return replace(self, home=self.home + turns * self.ticks_per_turn)
