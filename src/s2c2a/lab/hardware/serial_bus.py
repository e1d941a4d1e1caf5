"""A servo bus on a serial line: ask, retry, verify and limit, whatever the protocol."""

import time
from abc import abstractmethod
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from math import isfinite
from typing import Any, ClassVar

from s2c2a.arm.servos import WAY_OUT
from s2c2a.lab.hardware.bus import (
    RESTARTED,
    BusError,
    Hearing,
    PortLostError,
    ServoBus,
    ServoInfo,
    ServoState,
    ServoStates,
    StoredChange,
)
from s2c2a.lab.hardware.packets import Answer, AnswerReader, Register, ServoPackets
from s2c2a.lab.hardware.presence import DAMAGED, hear
from s2c2a.lab.hardware.serial_line import SerialLine

ATTEMPTS = 3
"""Attempts to read or write a register of one servo; noise spoils single packets."""
CYCLE_MARGIN = 0.02
"""Wait beyond wire time and latency of the adapter, in a cycle [s]; many adapters keep
bytes for up to 16 ms and do not say so."""
EXCHANGE_MARGIN = 0.2  # s; the same, outside of a cycle
LISTEN_MARGIN = 0.05  # s; the same, to find out whether a servo is there
ALIAS = "secondary_id"  # register of another id that a servo obeys
QUIET_TIME = 0.02  # s without a byte, after which no late answer is on its way


class SerialBus(ServoBus):
    """Servos of one brand and model on a serial port.

    A subclass knows packets, registers, and what the brand does differently.

    Attributes:
        brand: of the servos, for messages.
        packets: of the protocol.
        registers: of the servos by name.
        models: that are known, by name.
        limit_register: name of the register of the current limit in use.
        model: facts of the servos' model.
        restarted: see `ServoBus`.
    """

    ticks_per_turn = 4096
    brand: ClassVar[str]
    packets: ClassVar[ServoPackets]
    registers: Mapping[str, Register]
    models: Mapping[str, Any]
    limit_register: str

    def __init__(
        self,
        port: str,
        baud_rate: int,
        model: str,
        max_current: float | None,
        line: SerialLine | None = None,
    ):
        """Open the port; no servo is asked yet.

        Args:
            port: serial port.
            baud_rate: speed of the bus [bit/s].
            model: a name in `models`.
            max_current: largest current of any motion [A]; by default the model's.
            line: of servos of another model on the same port; by default, it is opened.

        Raises:
            BusError: unknown model or speed, or the port cannot be opened.
        """
        if model not in self.models:
            raise BusError(
                f"no {self.brand} model '{model}' is known; choose one of "
                f"{', '.join(self.models)}, {WAY_OUT}"
            )
        self._baud_code(baud_rate)
        self.model = self.models[model]
        self._model_name = model
        self.torque_constant = self.model.torque_constant
        largest = self.model.max_current
        self._max_current = min(max_current or largest, largest)
        self._stored_limits: dict[int, int] = {}
        self.restarted: set[int] = set()
        self._line = line or SerialLine(port, baud_rate)

    @property
    def line(self) -> SerialLine:
        """The open serial line."""
        return self._line

    @abstractmethod
    def info(self, id: int) -> ServoInfo:
        """Return the identity of one servo.

        Raises:
            BusError: the servo does not answer.
        """

    @abstractmethod
    def _stored_changes(self, id: int) -> list[StoredChange]:
        """Changes of stored settings; only what differs is written."""

    def _changes_of_others(
        self, ids: Collection[int]
    ) -> dict[int, Sequence[StoredChange]]:
        """Changes of all other servos that obey one of these ids, too."""
        return {}

    @abstractmethod
    def _read_states(self, ids: Sequence[int]) -> dict[int, ServoState | None]:
        """States of the servos that answer; None of one that lost its settings."""

    @abstractmethod
    def _prepare_one(
        self,
        info: ServoInfo,
        changes: Sequence[StoredChange],
        current: float,
        speed: float,
    ) -> None:
        """Store changes and set the limits of a servo whose torque is off."""

    @abstractmethod
    def _probes(self, id: int) -> Sequence[tuple[bytes, int]]:
        """Reads of identity and measurements, and the sizes of their answers."""

    def _check_refusal(self, answer: Answer, purpose: str) -> None:
        """Check that a servo does what it was told, in a protocol that says so."""

    def set_baud_rate(self, baud_rate: int) -> None:
        """Change the speed of the port; see `ServoBus`.

        Raises:
            BusError: servos have no such baud rate.
        """
        self._baud_code(baud_rate)
        self._line.baud_rate = baud_rate

    def prepare(self, ids: Iterable[int], current: float, speed: float) -> None:
        """Set settings and limits with the torque off; see `ServoBus`."""
        check_positive(current, "current")
        check_positive(speed, "speed")
        ids = tuple(ids)
        infos = [self.info(id) for id in ids]
        for info in infos:
            self.check_model(info, self._model_name, self.model.number)
        changes = {id: self._stored_changes(id) for id in ids}
        accepted = self.confirm_stored({**changes, **self._changes_of_others(ids)})
        # others obey this, too, and store nothing before
        self.set_torque(ids, on=False)
        # no servo shall store what another one is told
        for id, row in accepted.items():
            for change in row:
                if change.name == ALIAS:
                    self.write(id, change.name, change.new)
        self.restarted -= set(ids)
        for info in infos:
            self._prepare_one(info, accepted.get(info.id, ()), current, speed)

    def read_states(self, ids: Iterable[int]) -> ServoStates:
        """Read the states of servos, and switch off those that restarted.

        See `ServoBus`.
        """
        answers = self._read_states(tuple(ids))
        without = {id for id, state in answers.items() if state is None}
        # one damaged answer can look like that of a servo that has restarted
        again = self._read_states(sorted(without - self.restarted))
        self.restarted |= {id for id, state in again.items() if state is None}
        lost = self.restarted & answers.keys()
        # some have torque at their start, without the limits of `prepare`
        self._sync_write("torque", dict.fromkeys(sorted(lost), 0))
        return {
            id: state
            for id, state in (answers | again).items()
            if state is not None and id not in lost
        }

    def _checked_states(self, ids: Sequence[int]) -> ServoStates:
        """States of servos that are to be switched on.

        Raises:
            BusError: one of them is silent, or lost goal and limits.
        """
        states = self.read_patiently(ids, EXCHANGE_MARGIN)
        for id in ids:
            if id in self.restarted:
                raise BusError(f"servo {id} {RESTARTED}")
            if id not in states:
                raise self._absence(id)
        return states

    def set_current(self, ids: Iterable[int], current: float) -> None:
        """Set the largest current; see `ServoBus`.

        Raises:
            BusError: servos do not answer, or the current is not a positive number.
        """
        check_positive(current, "current")
        units = self._current_units(min(current, self._max_current))
        limits = {id: self._stored_limits.get(id, units) for id in ids}
        values = {id: max(min(units, limit), 1) for id, limit in limits.items()}
        self._write_values(self.limit_register, values)

    def listen(self, id: int) -> Hearing:
        """Ask one servo for its identity and its measurements; see `ServoBus`."""
        return hear(lambda: self._listen_once(id), ATTEMPTS)

    def close(self) -> None:
        """Close the port; see `ServoBus`."""
        self._line.close()

    def read(self, id: int, name: str) -> int:
        """Return a register of a servo, by its name in `registers`.

        Raises:
            BusError: the servo does not answer.
        """
        register = self.registers[name]
        return register.decode(self._read(id, register))

    def write(self, id: int, name: str, value: int) -> None:
        """Write a register of a servo and wait for the confirmation.

        Raises:
            ServoRefusalError: the servo refuses the value.
            BusError: the servo does not answer.
        """
        packet = self.packets.write(id, self.registers[name], value)
        self._ask(id, packet, 0, f"writing {name} = {value}")

    def _read(self, id: int, register: Register) -> bytes:
        packet = self.packets.read(id, register)
        return self._ask(id, packet, register.size, "reading").data

    def _sync_write(self, name: str, values: Mapping[int, int]) -> None:
        """Write a register of servos in one packet, if any, without confirmation."""
        if values:
            self._line.write(self.packets.sync_write(values, self.registers[name]))

    def _write_values(self, name: str, values: Mapping[int, int]) -> None:
        """Write a register of all servos, also after one of them failed.

        Raises:
            BusError: names all servos that failed, with the error of the first.
        """
        failures: dict[int, BusError] = {}
        for id, value in values.items():
            try:
                self.write(id, name, value)
            except PortLostError:
                raise
            except BusError as error:
                failures[id] = error
        if len(failures) > 1:
            raise BusError(f"servos {list(failures)}: {next(iter(failures.values()))}")
        for failure in failures.values():
            raise failure

    def _note_stored_limit(self, id: int, limit: int) -> None:
        """Remember the stored limit of the current, which no motion exceeds."""
        self._stored_limits[id] = limit
        if limit < self._current_units(self._max_current):
            stored = limit * self.model.current_unit
            self.warn_of_low_limit(id, stored, self._max_current)

    def _current_units(self, current: float) -> int:
        """Current as the servos count it, at least one unit: zero can mean no limit."""
        return max(round(current / self.model.current_unit), 1)

    def _baud_code(self, baud_rate: int) -> int:
        """Number of a speed in the register `baud_rate`."""
        if baud_rate not in self.baud_rates:
            raise BusError(
                f"{self.brand} servos have no baud rate {baud_rate}; choose one of "
                f"{', '.join(map(str, self.baud_rates))}"
            )
        return self.baud_rates.index(baud_rate)

    def _listen_once(self, id: int) -> Iterator[tuple[bytes, int]]:
        """Yield what comes back and its valid answers, for each request."""
        margin = self._line.latency + LISTEN_MARGIN
        quiet_time = self._line.latency + QUIET_TIME
        for packet, size in self._probes(id):
            count = len(packet) + self.packets.overhead + size
            patience = self._line.wire_time(count) + margin
            heard = self._line.ask(packet, patience, quiet_time)
            reader = self.packets.reader({id}, size)
            answers = [*reader.feed(heard), *reader.flush()]
            yield heard, sum(answer.id == id for answer in answers)

    def _ask(self, id: int, packet: bytes, size: int, purpose: str) -> Answer:
        """Send an instruction to one servo and return its answer.

        Args:
            id: of the servo.
            packet: instruction.
            size: number of bytes that a read returns.
            purpose: description of the access, for the error message.

        Raises:
            ServoRefusalError: the servo refuses the instruction.
            BusError: the servo does not answer.
        """
        for _ in range(ATTEMPTS):
            reader = self.packets.reader({id}, size)
            for answer in self._exchange(packet, reader, size, EXCHANGE_MARGIN, {id}):
                self._check_refusal(answer, purpose)
                if answer.id == id and len(answer.data) == size:
                    return answer
            # a late answer must not be taken for that of the next attempt
            self._line.drain(QUIET_TIME)
        if self.listen(id) in (Hearing.DAMAGED, Hearing.DOUBLED):
            raise BusError(f"servo {id} does not answer clearly: {DAMAGED}")
        raise self._absence(id)

    def _absence(self, id: int) -> BusError:
        return BusError(
            f"servo {id} on {self._line.port} does not answer at "
            f"{self._line.baud_rate} bit/s; check its cable, its power and its id "
            "(`s2c2a motors scan`)"
        )

    def _exchange(
        self,
        packet: bytes,
        reader: AnswerReader,
        size: int,
        margin: float,
        awaited: Collection[int],
        answers: int = 1,
    ) -> Iterator[Answer]:
        """Send an instruction, and yield the answers to it.

        Args:
            packet: instruction.
            reader: of the answers.
            size: of the data in each answer [bytes].
            margin: longest wait beyond the time on the line [s].
            awaited: servos whose answers end the exchange.
            answers: number of servos that answer.
        """
        count = len(packet) + answers * (self.packets.overhead + size)
        duration = self._line.wire_time(count) + self._line.latency + margin
        self._line.write(packet)
        yield from self._receive(reader, duration, awaited)

    def _receive(
        self, reader: AnswerReader, duration: float, awaited: Collection[int]
    ) -> Iterator[Answer]:
        """Yield answers until all awaited servos answered, or the time is over."""
        remaining = set(awaited)
        deadline = time.perf_counter() + duration
        while data := self._line.read(deadline):
            for answer in reader.feed(data):
                remaining.discard(answer.id)
                yield answer
            if awaited and not remaining:
                return
            # a line that is never quiet must not block the caller
            if time.perf_counter() > deadline:
                break
        yield from reader.flush()


def stored_changes(
    stored: Mapping[str, int], required: Mapping[str, int], wanted: Mapping[str, int]
) -> list[StoredChange]:
    """Return the changes from stored settings to those that are required or wanted."""
    return [
        StoredChange(name, stored[name], value, is_required=name in required)
        for name, value in {**required, **wanted}.items()
        if stored[name] != value
    ]


def check_positive(value: float, name: str) -> None:
    """Check a limit.

    Raises:
        BusError: it is not a positive number.
    """
    if not isfinite(value) or value <= 0:
        raise BusError(f"a limit of {name} must be positive and finite, got {value}")
