"""Bring-up of an arm with servos: jog, home and check its cables.

Nothing moves without the consent of the operator, who is asked before every motion.
"""

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from datetime import UTC, datetime

import numpy as np

from s2c2a.arm import ArmSpec, servos_of
from s2c2a.errors import S2C2AError
from s2c2a.lab.hardware.bus import BusError, ServoBus, ServoInfo, ServoStates
from s2c2a.lab.hardware.calibration import CalibratedServo, Calibration
from s2c2a.lab.hardware.monitor import describe_faults
from s2c2a.lab.hardware.motion_watch import MotionWatch
from s2c2a.lab.hardware.presence import check_presence
from s2c2a.lab.hardware.winch import (
    NO_SERVO,
    Winches,
    check_plausible,
    check_ticks,
    servo_ids,
    taut_windings,
    torque_constants,
)
from s2c2a.runtime.emergency import EMERGENCY_STOP, EmergencyStopError

HOME_SPEED = 0.02  # m/s
MAX_LEAD = 0.005
"""Largest distance of a goal from its cable [m]. A servo whose program died goes no
farther, also without a watchdog. A servo 5 mm from its goal pulls with its full current,
and the cable moves by 1 mm between two goals."""
MAX_SLACK = 0.08  # m; the longest slack that is wound in
STILL_TICKS = 8  # largest change of a position that counts as standing still
STILL_TIME = 0.5  # s for which a taut cable stands still
CURRENT_STEPS = (0.5, 0.75, 1.0)  # parts of the home current
AVERAGED_READINGS = 10
TIMEOUT = 15.0  # s for one motion
POLL_PERIOD = 0.05  # s
WATCHDOG_POLLS = 4  # at least, before the watchdog of a servo stops it
RELAXATION = 0.004  # m that a cable is paid out between repeated homings
CHECK_TRAVEL = 0.003  # m
CHECK_ERROR = 0.0007  # m; largest error of the position
CHECK_TENSION = 0.3  # N; smallest rise of the tension
PATIENCE = 1.0  # s for an answer of a servo

Confirm = Callable[[str], bool]
Report = Callable[[str], None]


class DeclinedError(S2C2AError):
    """The operator declined a motion."""


class BringUp:
    """Careful motions of single cables and modules, before an arm is calibrated."""

    def __init__(
        self,
        bus: ServoBus,
        arm: ArmSpec,
        confirm: Confirm,
        report: Report,
        guard: Callable[[], AbstractContextManager] = nullcontext,
    ):
        """Prepare motions of an arm; nothing moves yet.

        Args:
            bus: servo bus of the arm.
            arm: description of the arm; without a table `[servos]`, with default servos.
            confirm: announces a motion, or a change of stored settings, to the operator
                and returns whether the operator agrees.
            report: receives a line for the user.
            guard: is open during every motion, such as the keys that stop it.
        """
        check_ticks(arm, bus)
        bus.accept_stored = confirm
        self._bus = bus
        self._arm = arm
        self._servos = servos_of(arm)
        self._ids = servo_ids(arm)
        self._everyone = self._ids[self._ids != NO_SERVO].tolist()
        places = {int(id): place for place, id in np.ndenumerate(self._ids)}
        self._places = {id: places[id] for id in self._everyone}
        self._confirm = confirm
        self._report = report
        self._guard = guard
        self._powered: set[int] = set()
        self._poll_period = min(POLL_PERIOD, self._servos.watchdog / WATCHDOG_POLLS)
        self._torque_constants = torque_constants(arm, bus)
        parts = {id: self._servos.of(id) for id in self._everyone}
        self._currents = {id: part.limits.current for id, part in parts.items()}
        self._home_currents = {id: part.home_current for id, part in parts.items()}

    def jog(self, id: int, distance: float) -> float:
        """Move one cable and return the distance that it moved [m].

        Args:
            id: servo of the cable.
            distance: positive pays the cable out, negative winds it in [m].

        Raises:
            BusError: the servo does not answer, or does not belong to the arm.
            DeclinedError: the operator declined.
        """
        if id not in self._everyone:
            raise BusError(
                f"servo {id} does not belong to '{self._arm.name}'; choose one of "
                f"{self._everyone}"
            )
        self._check_presence([id])
        verb = "pays out" if distance > 0 else "winds in"
        length = f"{1000 * abs(distance):.1f} mm"
        self._ask(f"servo {id} ({self._servos.number_of(id)}) {verb} {length}")
        with self._moving([id], self._currents):
            winches = self._winches_at([id])
            self._wind({id: distance}, winches)
            return self._displacement(winches, id)

    def home(
        self,
        infos: Sequence[ServoInfo],
        adapter: str = "",
        repeat: int = 3,
        before: Calibration | None = None,
        save: Callable[[Calibration], None] = lambda _: None,
    ) -> Calibration:
        """Take up the slack of every cable, module by module; straight is zero.

        All cables of a module are wound in with the same small current, so that the
        module stands straight. The stretch of the cables and their backlash, as the
        arm file states them, are subtracted.

        Args:
            infos: identity of all servos.
            adapter: serial number of the adapter.
            repeat: homings of every module; their spread is the repeatability.
            before: an unfinished calibration; its modules are skipped.
            save: called with the calibration after every module.

        Returns:
            The calibration.

        Raises:
            BusError: a servo does not answer, or a cable does not become taut.
            DeclinedError: the operator declined.
        """
        self._check_presence(self._everyone)
        missing = set(self._everyone) - {info.id for info in infos}
        if missing:
            raise BusError(
                f"no answer from servos {sorted(missing)}; check cable, power and id "
                "(`s2c2a motors scan`)"
            )
        done = {servo.id: servo for servo in before.servos} if before else {}
        calibration = self._calibration(done, adapter)
        for module, row in enumerate(self._servos.ids, 1):
            ids = list(row)
            if not ids:
                self._report(f"module {module}: no cables, skipped")
                continue
            if all(id in done for id in ids):
                self._report(f"module {module}: homed before, skipped")
                continue
            currents = sorted({self._home_currents[id] for id in ids})
            text = " and ".join(f"{current:g} A" for current in currents)
            self._ask(f"module {module}: servos {ids} wind in with {text}")
            homes = self._home_module(module - 1, ids, max(repeat, 1))
            done |= self._calibrated(ids, homes, infos)
            calibration = self._calibration(done, adapter)
            save(calibration)
        return calibration

    def check(self, calibration: Calibration) -> dict[int, str]:
        """Move every cable a little and compare position and tension.

        Returns:
            The fault of every cable by its servo, with advice; empty if there is none.

        Raises:
            BusError: a servo does not answer.
            DeclinedError: the operator declined.
            RobotError: a cable is out of its range; nothing moves.
        """
        ids = self._everyone
        self._check_presence(ids)
        self._ask(
            "all cables go to their homes together, then each one moves by "
            f"{1000 * CHECK_TRAVEL:g} mm"
        )
        with self._moving(ids, self._currents):
            winches = Winches.of(self._arm, calibration.home(self._arm))
            positions = self._positions(ids)
            winches = winches.in_same_turn(positions)
            check_plausible(winches.displacements(positions), self._arm)
            self._wind(dict.fromkeys(ids, 0.0), winches)
            return {id: self._check_cable(id, winches) for id in ids}

    def _check_presence(self, ids: list[int]) -> None:
        """Check that servos answer, before the operator is asked."""
        check_presence(self._bus, ids, self._servos.number_of, self._everyone)

    def _home_module(
        self, module: int, ids: list[int], repeat: int
    ) -> dict[int, list[int]]:
        """Homes [ticks] of the servos of a module, one for every repetition."""
        homes: dict[int, list[int]] = {id: [] for id in ids}
        stretch = taut_windings(self._arm, self._torque_constants)
        with self._moving(ids, self._home_currents):
            for number in range(repeat):
                winches = self._winches_at(ids)
                self._take_up(ids, winches)
                # mean of several readings of the positions [ticks], to average their
                # noise
                readings = [self._positions(ids) for _ in range(AVERAGED_READINGS)]
                taut = np.round(np.mean(readings, axis=0)).astype(int)
                at_home = Winches.of(self._arm, taut).positions(stretch)
                for id in ids:
                    homes[id].append(int(at_home[self._places[id]]))
                if number + 1 < repeat:
                    self._wind(dict.fromkeys(ids, RELAXATION), self._winches_at(ids))
            self._wind(dict.fromkeys(ids, 0.0), Winches.of(self._arm, at_home))
        means = {id: round(float(np.mean(values))) for id, values in homes.items()}
        self._report(f"module {module + 1}: home at {means} ticks")
        return homes

    def _take_up(self, ids: list[int], winches: Winches) -> None:
        """Wind cables in until all are taut, with a current that grows.

        The cables that become taut first are pulled out again by the others. With the
        last current all of them wind in, so that their backlash is on the same side.

        Raises:
            BusError: a cable does not become taut.
        """
        targets = dict.fromkeys(ids, -MAX_SLACK)
        for share in CURRENT_STEPS:
            for current, own in _by_current(ids, self._home_currents):
                self._bus.set_current(own, share * current)
            self._wind(targets, winches)
        for id in ids:
            wound = -self._displacement(winches, id)
            if wound > 0.95 * MAX_SLACK:
                raise BusError(
                    f"servo {id} ({self._servos.number_of(id)}) wound in "
                    f"{1000 * wound:.0f} mm and its cable is not taut: is it off its "
                    "pulley, or does servos.directions have the wrong sign?"
                )

    def _check_cable(self, id: int, winches: Winches) -> str:
        before = self._tension(id, winches)
        self._wind({id: -CHECK_TRAVEL}, winches)
        error = self._displacement(winches, id) + CHECK_TRAVEL
        rise = self._tension(id, winches) - before
        self._wind({id: 0.0}, winches)
        place = self._servos.number_of(id)
        fault = _cable_fault(error, rise)
        tension = "not measured" if math.isnan(rise) else f"{rise:+.1f} N"
        self._report(
            f"servo {id} ({place}): position off by {1000 * error:+.2f} mm, tension "
            f"{tension}{': ' if fault else ''}{fault}"
        )
        return fault

    def _calibrated(
        self, ids: list[int], homes: dict[int, list[int]], infos: Sequence[ServoInfo]
    ) -> dict[int, CalibratedServo]:
        identities = {info.id: info for info in infos}
        tick = (
            2 * np.pi * self._arm.motor.pulley_radius / self._arm.motor.ticks_per_turn
        )
        servos = {}
        for id in ids:
            values = homes[id]
            spread = float(np.std(values, ddof=1)) * tick if len(values) > 1 else None
            info = identities[id]
            servos[id] = CalibratedServo(
                id=id,
                model=info.model,
                firmware=info.firmware,
                home=round(float(np.mean(values))),
                spread=spread,
            )
        return servos

    def _calibration(
        self, done: dict[int, CalibratedServo], adapter: str
    ) -> Calibration:
        ids = self._everyone
        return Calibration(
            arm=self._arm.name,
            date=datetime.now(UTC).replace(microsecond=0),
            adapter=adapter,
            servos=tuple(done[id] for id in ids if id in done),
            finished=all(id in done for id in ids),
        )

    def _ask(self, motion: str) -> None:
        if not self._confirm(motion):
            raise DeclinedError(f"declined: {motion}; nothing moved")

    @contextmanager
    def _moving(self, ids: list[int], currents: Mapping[int, float]) -> Iterator[None]:
        """Let servos hold their place with a limited current, also after the motion.

        An error switches their torque off, an emergency stop that of all servos that
        this object switched on, unless `servos.on_emergency` is "hold".
        """
        try:
            with self._switched_on(ids, currents):
                yield
        except EmergencyStopError:
            # stop servos where they are, then hold or release all that have torque
            with suppress(BusError):
                self._bus.stop(ids, PATIENCE)
            if self._servos.on_emergency == "release":
                with suppress(BusError):
                    self._bus.set_torque(sorted(self._powered), on=False)
            raise

    @contextmanager
    def _switched_on(
        self, ids: list[int], currents: Mapping[int, float]
    ) -> Iterator[None]:
        EMERGENCY_STOP.check()
        speed = HOME_SPEED / self._arm.motor.pulley_radius
        for current, own in _by_current(ids, currents):
            self._bus.prepare(own, current, speed)
        states = self._states(ids)
        self._bus.send_goals({id: states[id].position for id in ids})
        try:
            # a failure may leave some of them on
            self._powered |= set(ids)
            with self._guard():
                self._bus.set_torque(ids, on=True)
                yield
        except EmergencyStopError:
            raise
        except BaseException:
            self._bus.set_torque(ids, on=False)
            raise

    def _wind(self, displacements: dict[int, float], winches: Winches) -> None:
        """Move cables to displacements [m], until they stand still.

        Goals go ahead of the cables by `MAX_LEAD` at most.

        Raises:
            BusError: the cables do not come to rest, or a servo is at fault.
            RobotError: the program stood still.
            EmergencyStopError: nothing must move.
        """
        ids = list(displacements)
        overdue = BusError(f"servos {ids} do not come to rest in {TIMEOUT:g} s")
        watch = MotionWatch(TIMEOUT, overdue)
        still_since = time.perf_counter()
        positions = last = self._positions(ids)
        while True:
            watch.check()  # not every servo has a watchdog that stops it
            self._lead(displacements, positions, winches)
            time.sleep(self._poll_period)
            positions = self._positions(ids)
            if (np.abs(positions - last) > STILL_TICKS).any():
                still_since = time.perf_counter()
                last = positions
            elif time.perf_counter() - still_since >= STILL_TIME:
                return

    def _lead(
        self, targets: Mapping[int, float], positions: np.ndarray, winches: Winches
    ) -> None:
        """Send goals on the way from positions [ticks] to displacements [m]."""
        goals = winches.displacements(positions)
        for id, target in targets.items():
            place = self._places[id]
            goals[place] += np.clip(target - goals[place], -MAX_LEAD, MAX_LEAD)
        wanted = winches.positions(goals)
        places = {id: self._places[id] for id in targets}
        ticks = {id: int(wanted[place]) for id, place in places.items()}
        self._bus.send_goals(ticks)

    def _states(self, ids: list[int]) -> ServoStates:
        EMERGENCY_STOP.check()
        states = self._bus.read_patiently(ids, PATIENCE)
        if fault := describe_faults(states, self._servos, ids, self._bus.restarted):
            raise BusError(fault)
        return states

    def _positions(self, ids: list[int]) -> np.ndarray:
        """Positions [ticks], shape (modules, cables); zero for other servos."""
        states = self._states(ids)
        positions = np.zeros(self._ids.shape, int)
        for id, state in states.items():
            positions[self._places[id]] = state.position
        return positions

    def _winches_at(self, ids: list[int]) -> Winches:
        """Winches whose zero is the present position of the cables."""
        return Winches.of(self._arm, self._positions(ids))

    def _displacement(self, winches: Winches, id: int) -> float:
        """Displacement of one cable [m]."""
        displacements = winches.displacements(self._positions([id]))
        return float(displacements[self._places[id]])

    def _tension(self, id: int, winches: Winches) -> float:
        """Tension of one cable [N], from its current."""
        current = self._states([id])[id].current
        currents = np.full(self._ids.shape, current)
        tensions = winches.tensions(currents, self._torque_constants)
        return float(tensions[self._places[id]])


def _by_current(
    ids: Sequence[int], currents: Mapping[int, float]
) -> list[tuple[float, list[int]]]:
    """Currents, and the servos that have them."""
    groups: dict[float, list[int]] = {}
    for id in ids:
        groups.setdefault(currents[id], []).append(id)
    return list(groups.items())


def _cable_fault(error: float, rise: float) -> str:
    if rise < -CHECK_TENSION:
        return (
            "the tension falls where the cable should be wound in; change the sign in "
            "servos.directions"
        )
    if rise < CHECK_TENSION:
        return "no tension: the cable has snapped, or is off its pulley"
    if abs(error) > CHECK_ERROR:
        return "it does not arrive: something is in its way, or the current is too low"
    return ""
