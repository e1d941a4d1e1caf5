"""Scripted Feetech servos behind an in-memory serial port."""

from collections.abc import Callable
from types import SimpleNamespace

HEADER = b"\xff\xff"
BROADCAST = 0xFE
RATES = (1_000_000, 500_000, 250_000, 128_000, 115_200, 76_800, 57_600, 38_400)
LOCK = 55
EPROM_END = 40


def packet(*body: int) -> bytes:
    """A packet of these bytes after the header, with its checksum."""
    return HEADER + bytes(body) + bytes((~sum(body) & 0xFF,))


def serve(port: "FakePort", monkeypatch) -> None:
    """Let every serial port that is opened from now on be this one."""
    module = SimpleNamespace(
        Serial=lambda *_, **__: port, SerialTimeoutException=TimeoutError
    )
    monkeypatch.setattr("s2c2a.lab.hardware.serial_line.import_serial", lambda: module)


class FakeServo:
    """Registers of one servo, with the settings of the factory."""

    def __init__(self, id: int):
        self.memory = bytearray(128)
        self.memory[0:5] = bytes((3, 10, 0, 9, 3))
        self.memory[5] = id
        self.memory[8] = 1
        self.memory[11:13] = b"\xff\x0f"
        self.memory[16:18] = b"\xe8\x03"
        self.memory[18] = 12
        self.memory[LOCK] = 1
        self.error = 0
        self.takes_full_angle = True
        self.changes_rate_at_once = True

    @property
    def id(self) -> int:
        return self.memory[5]

    @property
    def baud_rate(self) -> int:
        return RATES[self.memory[6] if self.changes_rate_at_once else 0]

    def set(self, address: int, *values: int) -> None:
        self.memory[address : address + len(values)] = bytes(values)

    def write(self, address: int, data: bytes) -> None:
        """Write as a servo does: EPROM only while it is unlocked."""
        if address >= EPROM_END or not self.memory[LOCK]:
            self.set(address, *data)
        if address <= 42 < address + len(data):
            self.memory[40] = 1  # a goal switches the torque on
        if not self.takes_full_angle:
            self.memory[18] &= ~16

    def answer(self, data: bytes = b"") -> bytes:
        return packet(self.id, len(data) + 2, self.error, *data)


class FakePort:
    """Port of pyserial with servos behind it; answers are ready at once.

    Attributes:
        sent: packets that were written.
        spoil: changes the answer of a servo, by id.
        echoes: whether the adapter returns what was sent.
    """

    def __init__(self, *ids: int):
        self.servos = [FakeServo(id) for id in ids]
        self.baudrate = 1_000_000
        self.sent: list[bytes] = []
        self.spoil: dict[int, Callable[[bytes], bytes]] = {}
        self.echoes = False
        self.failure: Exception | None = None
        self.is_open = True
        self._received = bytearray()

    def __getitem__(self, id: int) -> FakeServo:
        return next(servo for servo in self.servos if servo.id == id)

    @property
    def in_waiting(self) -> int:
        if self.failure is not None:
            raise self.failure
        return len(self._received)

    def read(self, count: int) -> bytes:
        data = bytes(self._received[:count])
        del self._received[:count]
        return data

    def write(self, data: bytes) -> None:
        if self.failure is not None:
            raise self.failure
        self.sent.append(data)
        if self.echoes:
            self._received += data
        self._execute(data[2], data[4], data[5:-1])

    def receive(self, data: bytes) -> None:
        """Add bytes that come without an instruction."""
        self._received += data

    def reset_input_buffer(self) -> None:
        if self.failure is not None:
            raise self.failure
        self._received.clear()

    def close(self) -> None:
        self.is_open = False

    def _execute(self, id: int, instruction: int, parameters: bytes) -> None:
        present = [s for s in self.servos if s.baud_rate == self.baudrate]
        servos = {servo.id: servo for servo in present}
        if instruction == 0x82:
            for asked in parameters[2:]:
                self._read(servos.get(asked), *parameters[:2])
        elif instruction == 0x83:
            (address, size) = parameters[:2]
            for start in range(2, len(parameters), size + 1):
                (target, *data) = parameters[start : start + size + 1]
                if target in servos:
                    servos[target].write(address, bytes(data))
        elif instruction == 0x02:
            self._read(servos.get(id), *parameters)
        elif id in servos:
            servos[id].write(parameters[0], parameters[1:])
            self._reply(id, servos[id].answer())

    def _read(self, servo: FakeServo | None, address: int, size: int) -> None:
        if servo is not None:
            data = servo.memory[address : address + size]
            self._reply(servo.id, servo.answer(bytes(data)))

    def _reply(self, id: int, answer: bytes) -> None:
        self._received += self.spoil.get(id, bytes)(answer)
