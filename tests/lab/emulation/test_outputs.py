"""Status file, poses and record of an emulator."""

import json
import socket

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.errors import S2C2AError
from s2c2a.lab.emulation.emulator import Emulator, EmulatorOptions
from s2c2a.lab.emulation.outputs import (
    PositionRecord,
    StatusFile,
    parse_address,
)
from s2c2a.lab.emulation.pose_datagrams import DatagramOptions, PoseDatagrams


@pytest.fixture(scope="module")
def emulator(tmp_path_factory):
    link = tmp_path_factory.mktemp("servos") / "port"
    emulator = Emulator(load_arm("twin_arm"), EmulatorOptions(homed=True, link=link))
    servo = emulator.servos[4]
    servo["operating_mode"] = 4
    servo["goal_position"] = round(servo.position) - 300
    servo["torque_enable"] = 1
    for _ in range(30):
        emulator.advance_chunk()
    return emulator


def test_the_status_file_shows_what_reached_the_servos(emulator, tmp_path):
    path = tmp_path / "status.json"
    output = StatusFile(path)
    output.write(emulator, 0.0)
    output.close()
    status = json.loads(path.read_text())
    servo = status["servos"][4]
    assert [one["torque"] for one in status["servos"]].count(True) == 1
    assert servo["displacement"] == pytest.approx(-300 * 2 * np.pi * 0.01 / 4096, 0.05)
    assert servo["tension"] > 0.5
    assert servo["current"] < -0.01
    assert status["largest_command"] == pytest.approx(0.0046, abs=1e-4)
    assert status["largest_current"] >= abs(servo["current"])


def test_poses_are_sent_as_json_datagrams(emulator):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(10.0)
        options = DatagramOptions(rate=100.0, receiver=receiver.getsockname())
        poses = emulator.plant.poses
        sender = PoseDatagrams(list(poses()), options)
        for moment in (1.5, 1.505, 1.52):
            sender.serve(moment, poses)
        contents = [json.loads(receiver.recv(65_536)) for _ in range(2)]
        sender.close()
    assert [content["frame"] for content in contents] == [0, 1]
    assert contents[0]["time"] == 1.5
    tip = contents[0]["bodies"]["end-3"]
    np.testing.assert_allclose(tip["position"], emulator.plant.states()[-1, :3])
    assert np.linalg.norm(tip["rotation"]) == pytest.approx(1.0)


def test_the_record_has_a_row_for_every_period_that_was_not_missed(emulator, tmp_path):
    path = tmp_path / "record.csv"
    record = PositionRecord(path, 3, 100.0)
    for time in (0.0, 0.004, 0.011, 5.0, 5.005, 5.009):
        record.write(emulator, time)
    record.close()
    lines = path.read_text().splitlines()
    assert lines[0] == "time,x1,y1,z1,x2,y2,z2,x3,y3,z3"
    times = [line.split(",")[0] for line in lines[1:]]
    assert times == ["0.000000", "0.011000", "5.000000", "5.005000"]


@pytest.mark.parametrize("text", ["9700", "host:", ":9700", "host:99999", "host:a"])
def test_an_invalid_address_names_an_example(text):
    with pytest.raises(S2C2AError, match=r"127\.0\.0\.1:9700"):
        parse_address(text)
