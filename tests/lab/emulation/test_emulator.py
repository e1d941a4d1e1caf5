"""Emulated servos as a command, driven by the manufacturers' own libraries."""

import json
import signal
import subprocess
import sys
from contextlib import contextmanager

import numpy as np
import pytest
from homes import arm_with_servos

from s2c2a.arm import load_arm
from s2c2a.cli.main import main
from s2c2a.errors import S2C2AError
from s2c2a.lab.emulation.emulator import Emulator, EmulatorOptions
from waiting import until

ARM = load_arm("twin_arm")
PATIENCE = 300.0  # s
SYNC_TRIES = 20

FEETECH_SERVOS = """
[servos]
protocol = "feetech"
model = "sts3215"
ids = [[1, 2, 3], [4, 5, 6], [7, 8, 9]]
"""


class Library:
    """A manufacturer's library at a port."""

    def __init__(self, sdk, version, name):
        self.sdk = sdk
        self.port = sdk.PortHandler(name)
        self.packets = sdk.PacketHandler(version)

    def positions(self, address, size, is_fast=False):
        read = self.sdk.GroupSyncRead(self.port, self.packets, address, size)
        assert all(read.addParam(id) for id in range(1, 10))
        exchange = read.fastSyncRead if is_fast else read.txRxPacket
        repeat(exchange, lambda result: result == 0)
        return [read.getData(id, address, size) for id in range(1, 10)]


@contextmanager
def emulated(folder, sdk, version, *options):
    """Start the command, and let a library open its port."""
    port_file = folder / "name"
    command = [sys.executable, "-m", "s2c2a", "emulate", "servos", "--homed"]
    command += ["--link", str(folder / "port"), "--port-file", str(port_file)]
    process = subprocess.Popen([*command, *map(str, options)])
    until(port_file.exists)
    library = Library(sdk, version, port_file.read_text().strip())
    try:
        assert library.port.setBaudRate(1_000_000)
        yield library
    finally:
        library.port.closePort()
        process.send_signal(signal.SIGTERM)
        code = process.wait(PATIENCE)
    assert code == 0
    assert not (folder / "port").exists()


def repeat(exchange, is_good):
    """Repeat an exchange on a busy machine, where answers may come late."""
    for _ in range(SYNC_TRIES):
        result = exchange()
        if is_good(result):
            return result
    pytest.fail(f"no valid answer in {SYNC_TRIES} tries, last {result}")


def test_the_dynamixel_library_drives_the_servos(tmp_path):
    sdk = pytest.importorskip("dynamixel_sdk")
    status_file = tmp_path / "status.json"

    def has_torque():
        """Whether the third servo has torque, as the status states from time to time."""
        return json.loads(status_file.read_text())["servos"][2]["torque"]

    with emulated(tmp_path, sdk, 2.0, "--status-file", status_file) as library:
        port, packets = library.port, library.packets

        def write(register, value, error=0):
            repeat(
                lambda: packets.write1ByteTxRx(port, 3, register, value),
                lambda answer: answer == (0, error),
            )

        model = repeat(lambda: packets.ping(port, 3), lambda answer: answer[1] == 0)
        assert model[0] == 1200
        write(11, 4)
        write(64, 1)
        write(11, 3, error=7)  # locked
        slow = library.positions(132, 4)
        fast = library.positions(132, 4, is_fast=True)
        assert max(abs(a - b) for a, b in zip(slow, fast, strict=True)) < 20
        goals = sdk.GroupSyncWrite(port, packets, 116, 4)
        goals.addParam(3, list((slow[2] + 200).to_bytes(4, "little")))
        goals.txPacket()
        until(lambda: abs(library.positions(132, 4)[2] - slow[2] - 200) <= 20)
        until(has_torque)


def test_the_feetech_library_drives_the_servos(tmp_path):
    sdk = pytest.importorskip("scservo_sdk")
    arm_file = tmp_path / "arm.toml"
    main(["arm", "copy", "twin_arm", str(arm_file)])
    arm_file.write_text(arm_file.read_text() + FEETECH_SERVOS)
    with emulated(tmp_path, sdk, 0, "--arm", arm_file) as library:
        model = repeat(
            lambda: library.packets.ping(library.port, 3),
            lambda answer: answer[1] == 0,
        )
        assert model[0] == 777
        assert all(0 <= position < 4096 for position in library.positions(56, 2))


def test_positions_follow_from_directions_and_home(tmp_path):
    directions = [[1, -1, 1], [-1, 1, 1], [1, 1, -1]]
    table = {"ids": [[9, 8, 7], [6, 5, 4], [3, 2, 1]], "directions": directions}
    emulator = Emulator(
        arm_with_servos(**table), EmulatorOptions(link=tmp_path / "port")
    )
    winch = emulator.winches[1]
    before = winch.servo.position
    winch.servo["operating_mode"] = 4
    winch.servo["goal_position"] = round(before) - 200
    winch.servo["torque_enable"] = 1
    displacement = emulator.plant.positions[1]
    for _ in range(100):
        emulator.advance_chunk()
    assert winch.servo.id == 8
    paid_out = emulator.plant.positions[1] - displacement
    assert paid_out == pytest.approx(200 * 2 * np.pi * 0.01 / 4096, abs=5e-5)
    assert winch.servo.position == pytest.approx(before - 200, abs=5)


def test_a_baud_rate_that_the_servos_do_not_know_is_refused():
    arm = arm_with_servos(baud_rate=500_000)
    with pytest.raises(S2C2AError, match="choose one of 9600, 57600"):
        Emulator(arm, EmulatorOptions())


def test_the_emulator_ends_after_its_duration(tmp_path):
    options = EmulatorOptions(link=tmp_path / "port", duration=0.05)
    emulator = Emulator(ARM, options)
    names = []
    emulator.run(names.append)
    assert names == [str(tmp_path / "port")]
    assert not (tmp_path / "port").exists()
