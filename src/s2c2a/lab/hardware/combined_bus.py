"""Several servo buses as one: other ports, or other models on the same port."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress

from s2c2a.lab.hardware.bus import (
    BusError,
    Hearing,
    PortLostError,
    ServoBus,
    ServoInfo,
    ServoStates,
)

Action = Callable[[ServoBus, list[int]], None]


class CombinedBus(ServoBus):
    """Buses that share the servos of one arm; a failure of one stops all.

    What stops or releases servos reaches every bus, also after one of them failed.
    """

    def __init__(self, parts: Sequence[tuple[ServoBus, Sequence[int]]]):
        """Combine open buses.

        Args:
            parts: buses with the ids of their servos, which differ among all.
        """
        self._buses = [bus for bus, _ in parts]
        self._owners = {id: bus for bus, ids in parts for id in ids}
        first = self._buses[0]
        self.ticks_per_turn = first.ticks_per_turn
        self.torque_constant = first.torque_constant
        self.baud_rates = first.baud_rates
        self.has_current = all(bus.has_current for bus in self._buses)
        self._powered: set[int] = set()

    @property
    def restarted(self) -> set[int]:  # type: ignore[override]
        """Servos of any bus that lost their settings."""
        return set().union(*(bus.restarted for bus in self._buses))

    @property
    def accept_stored(self) -> Callable[[str], bool]:
        """Whom all buses ask before stored settings change."""
        return self._buses[0].accept_stored

    @accept_stored.setter
    def accept_stored(self, accept: Callable[[str], bool]) -> None:
        for bus in self._buses:
            bus.accept_stored = accept

    @property
    def has_watchdog(self) -> bool:  # type: ignore[override]
        """Whether the servos of every bus stop by themselves."""
        return all(bus.has_watchdog for bus in self._buses)

    def torque_constant_of(self, id: int) -> float:
        """Return the torque per current of a servo [N m/A]."""
        return self._owner(id).torque_constant_of(id)

    def scan(self, ids: Iterable[int] = ()) -> list[ServoInfo]:
        """Return the servos of the arm that answer; see `ServoBus`."""
        found: list[ServoInfo] = []
        for bus, own in self._split(list(ids) or self._owners):
            found += bus.scan(own)
        return found

    def set_baud_rate(self, baud_rate: int) -> None:
        """Change the speed of every port; see `ServoBus`."""
        for bus in self._buses:
            bus.set_baud_rate(baud_rate)

    def assign(self, id: int, new_id: int, baud_rate: int) -> None:
        """Store another id and baud rate in a servo; see `ServoBus`."""
        self._owner(id).assign(id, new_id, baud_rate)

    def prepare(self, ids: Iterable[int], current: float, speed: float) -> None:
        """Prepare servos; those of a bus after the one that refuses stay as they are."""
        for bus, own in self._split(ids):
            bus.prepare(own, current, speed)

    def set_torque(self, ids: Iterable[int], on: bool) -> None:
        """Switch the torque; where one bus fails to switch on, all switch off."""
        ids = list(ids)
        if not on:
            self._powered -= set(ids)
            return self._everywhere(ids, lambda bus, own: bus.set_torque(own, False))
        self._powered |= set(ids)
        try:
            for bus, own in self._split(ids):
                bus.set_torque(own, True)
        except BaseException:
            with suppress(BusError):
                self.set_torque(ids, on=False)
            raise

    def set_current(self, ids: Iterable[int], current: float) -> None:
        """Set the largest current; see `ServoBus`."""
        self._everywhere(ids, lambda bus, own: bus.set_current(own, current))

    def arm_watchdog(self, ids: Iterable[int], seconds: float) -> None:
        """Let servos stop by themselves; see `ServoBus`."""
        self._everywhere(ids, lambda bus, own: bus.arm_watchdog(own, seconds))

    def send_goals(self, goals: Mapping[int, int]) -> None:
        """Send goal positions, one packet a bus.

        Raises:
            PortLostError: a port is gone; the servos of the others stop where they are.
        """
        try:
            for bus, own in self._split(goals):
                bus.send_goals({id: goals[id] for id in own})
        except PortLostError:
            with suppress(BusError):
                self.stop(list(self._owners), 0.0)
            raise

    def read_states(self, ids: Iterable[int]) -> ServoStates:
        """Read the states, one bus after the other; see `ServoBus`.

        A bus without any of these servos hears a packet too if it has torque, so that
        its watchdog runs out only when the program fails.
        """
        states: ServoStates = {}
        asked: list[ServoBus] = []
        for bus, own in self._split(ids):
            states |= bus.read_states(own)
            asked.append(bus)
        for bus, own in self._split(self._powered):
            if bus not in asked:
                bus.read_states(own[:1])
        return states

    def stop(self, ids: Sequence[int], seconds: float) -> None:
        """Stop servos where they are, also those beside a port that is gone."""
        self._everywhere(ids, lambda bus, own: bus.stop(own, seconds))

    def listen(self, id: int) -> Hearing:
        """Ask one servo alone; see `ServoBus`."""
        return self._owner(id).listen(id)

    def reboot(self, id: int) -> None:
        """Restart a servo; see `ServoBus`."""
        self._owner(id).reboot(id)

    def close(self) -> None:
        """Close all ports, also after one of them failed."""
        with ExitStack() as stack:
            for bus in self._buses:
                stack.callback(bus.close)

    def _owner(self, id: int) -> ServoBus:
        if id not in self._owners:
            raise BusError(
                f"servo {id} is on no bus of the arm; choose one of "
                f"{sorted(self._owners)}"
            )
        return self._owners[id]

    def _split(self, ids: Iterable[int]) -> Iterator[tuple[ServoBus, list[int]]]:
        """Buses with their own of some servos."""
        rows: dict[int, list[int]] = {}
        for id in ids:
            rows.setdefault(self._buses.index(self._owner(id)), []).append(id)
        for number, own in sorted(rows.items()):
            yield self._buses[number], own

    def _everywhere(self, ids: Iterable[int], act: Action) -> None:
        """Act on every bus, and then raise the first error."""
        errors: list[BusError] = []
        for bus, own in self._split(ids):
            try:
                act(bus, own)
            except BusError as error:
                errors.append(error)
        if errors:
            raise errors[0]
