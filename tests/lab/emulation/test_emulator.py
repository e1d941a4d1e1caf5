"""Emulated servos as a command, driven by the manufacturers' own libraries."""

import json
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.cli.main import main
from s2c2a.errors import S2C2AError
from s2c2a.lab.emulation.emulator import Emulator, EmulatorOptions

ARM = load_arm("twin_arm")
PATIENCE = 300.0  # s
SYNC_TRIES = 20

FEETECH_SERVOS = """
[servos]
protocol = "feetech"
model = "sts3215"
ids = [[1, 2, 3], [4, 5, 6], [7, 8, 9]]
"""


def start(folder, *options):
    """Start the command; returns its process and the name of its port."""
    port_file = folder / "name"
    command = [sys.executable, "-m", "s2c2a", "emulate", "servos"]
    command += ["--link", str(folder / "port"), "--port-file", str(port_file)]
    process = subprocess.Popen([*command, *map(str, options)])
    limit = time.monotonic() + PATIENCE
    while not port_file.exists() and time.monotonic() < limit:
        time.sleep(0.05)
    return process, port_file.read_text().strip()


def stop(process):
    process.send_signal(signal.SIGTERM)
    return process.wait(PATIENCE)


def repeat(exchange, is_good):
    """Repeat an exchange on a busy machine, where answers may come late."""
    for _ in range(SYNC_TRIES):
        result = exchange()
        if is_good(result):
            return result
    pytest.fail(f"no valid answer in {SYNC_TRIES} tries, last {result}")


def torque_of_third(status_file):
    """Whether the third servo has torque, as the status states from time to time."""
    return json.loads(status_file.read_text())["servos"][2]["torque"]


def test_the_dynamixel_library_drives_the_servos(tmp_path):
    sdk = pytest.importorskip("dynamixel_sdk")
    status_file = tmp_path / "status.json"
    process, name = start(tmp_path, "--status-file", status_file, "--homed")
    port = sdk.PortHandler(name)
    packets = sdk.PacketHandler(2.0)
    try:
        assert port.setBaudRate(1_000_000)
        model = repeat(lambda: packets.ping(port, 3), lambda answer: answer[1] == 0)
        for register, value in ((11, 4), (64, 1)):
            repeat(
                lambda register=register, value=value: packets.write1ByteTxRx(
                    port, 3, register, value
                ),
                lambda answer: answer == (0, 0),
            )
        locked = repeat(
            lambda: packets.write1ByteTxRx(port, 3, 11, 3), lambda answer: not answer[0]
        )
        read = sdk.GroupSyncRead(port, packets, 132, 4)
        assert all(read.addParam(id) for id in range(1, 10))
        repeat(read.txRxPacket, lambda result: result == 0)
        slow = [read.getData(id, 132, 4) for id in range(1, 10)]
        repeat(read.fastSyncRead, lambda result: result == 0)
        fast = [read.getData(id, 132, 4) for id in range(1, 10)]
        write = sdk.GroupSyncWrite(port, packets, 116, 4)
        write.addParam(3, list((slow[2] + 200).to_bytes(4, "little")))
        write.txPacket()
        moved = slow[2]
        limit = time.monotonic() + PATIENCE
        while abs(moved - slow[2] - 200) > 20 and time.monotonic() < limit:
            repeat(read.txRxPacket, lambda result: result == 0)
            moved = read.getData(3, 132, 4)
        while not torque_of_third(status_file) and time.monotonic() < limit:
            time.sleep(0.05)
    finally:
        port.closePort()
        code = stop(process)
    assert model[0] == 1200
    assert locked[1] == 7
    assert max(abs(a - b) for a, b in zip(slow, fast, strict=True)) < 20
    assert moved == pytest.approx(slow[2] + 200, abs=20)
    assert code == 0
    assert torque_of_third(status_file)
    assert not (tmp_path / "port").exists()


def test_the_feetech_library_drives_the_servos(tmp_path):
    sdk = pytest.importorskip("scservo_sdk")
    arm_file = tmp_path / "arm.toml"
    main(["arm", "copy", "twin_arm", str(arm_file)])
    arm_file.write_text(arm_file.read_text() + FEETECH_SERVOS)
    process, name = start(tmp_path, "--arm", arm_file, "--homed")
    port = sdk.PortHandler(name)
    packets = sdk.PacketHandler(0)
    try:
        assert port.setBaudRate(1_000_000)
        model = repeat(lambda: packets.ping(port, 3), lambda answer: answer[1] == 0)
        read = sdk.GroupSyncRead(port, packets, 56, 2)
        assert all(read.addParam(id) for id in range(1, 10))
        repeat(read.txRxPacket, lambda result: result == 0)
        positions = [read.getData(id, 56, 2) for id in range(1, 10)]
    finally:
        port.closePort()
        code = stop(process)
    assert model[0] == 777
    assert all(0 <= position < 4096 for position in positions)
    assert code == 0


def test_positions_follow_from_directions_and_home(tmp_path):
    directions = [[1, -1, 1], [-1, 1, 1], [1, 1, -1]]
    table = {"ids": [[9, 8, 7], [6, 5, 4], [3, 2, 1]], "directions": directions}
    arm = type(ARM).model_validate(ARM.model_dump() | {"servos": table})
    emulator = Emulator(arm, EmulatorOptions(link=tmp_path / "port"))
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
    table = {"ids": [[1, 2, 3], [4, 5, 6], [7, 8, 9]], "baud_rate": 500_000}
    arm = type(ARM).model_validate(ARM.model_dump() | {"servos": table})
    with pytest.raises(S2C2AError, match="choose one of 9600, 57600"):
        Emulator(arm, EmulatorOptions())


def test_the_emulator_ends_after_its_duration(tmp_path):
    options = EmulatorOptions(link=tmp_path / "port", duration=0.05)
    emulator = Emulator(ARM, options)
    names = []
    emulator.run(names.append)
    assert names == [str(tmp_path / "port")]
    assert not (tmp_path / "port").exists()


def test_a_port_returns_after_it_was_unplugged(tmp_path):
    faults = ("0.1 unplug 0.2",)
    options = EmulatorOptions(faults=faults, link=tmp_path / "port")
    emulator = Emulator(ARM, options)
    emulator.line.plug()
    plugged = []
    for emulator.now in (0.05, 0.15, 0.25, 0.4):
        emulator.serve()
        plugged.append((tmp_path / "port").exists())
    emulator.line.unplug()
    assert plugged == [True, False, False, True]
