"""Emulated QTM and JSON sender: options, answers, faults before the encoding."""

import json
import socket

import numpy as np
import pytest
from streams import free_port

from s2c2a.arm import load_arm
from s2c2a.lab.emulation import qualisys_protocol as protocol
from s2c2a.lab.emulation.mocap import MocapEmulator
from s2c2a.lab.emulation.plant import FramePose
from s2c2a.lab.emulation.pose_datagrams import DatagramOptions, PoseDatagrams
from s2c2a.lab.emulation.qtm import Qtm, QtmOptions
from s2c2a.lab.emulation.tracked_bodies import flip

NAMES = ["base", "end-1"]
UP = np.array([0.0, 0.0, 0.0, 1.0])
POSES = {name: FramePose(np.array([0.0, 0.0, 0.1]), UP) for name in NAMES}


@pytest.fixture
def dialogue():
    """A function that sends a command and returns the answer of a QTM."""
    port = free_port(socket.SOCK_STREAM)
    qtm = Qtm(NAMES, QtmOptions(port=port, version="1.20"))
    qtm.open()
    client = socket.create_connection(("127.0.0.1", port))
    client.settimeout(5.0)
    serve = qtm._answer_requests
    serve(0.0)
    client.recv(4096)

    def ask(command):
        client.sendall(protocol.pack_text(protocol.COMMAND, command))
        data = b""
        while not data:
            serve(0.0)
            client.settimeout(0.05)
            try:
                data = client.recv(4096)
            except TimeoutError:
                continue
        return data[8:].rstrip(b"\0").decode()

    yield ask
    client.close()
    qtm.close()


@pytest.mark.parametrize(
    ("command", "answer"),
    [
        ("Version 1.20", "Version set to 1.20"),
        ("version 1.25", "Version NOT supported"),
        ("Version x", "Version NOT supported"),
        ("Version", "Version is 1.1"),
        ("ByteOrder", "Byte order is little endian"),
        ("StreamFrames AllFrames 6DEuler", "Parse error"),
        ("Dance", "Parse error"),
    ],
)
def test_commands_have_the_answers_of_the_documentation(dialogue, command, answer):
    assert dialogue(command) == answer


def test_parameters_have_axis_and_names(dialogue):
    text = dialogue("GetParameters 3D 6D")
    assert "<AxisUpwards>+Z</AxisUpwards>" in text
    assert "<Name>base</Name>" in text


def test_a_half_turn_about_x_turns_y_and_z():
    flipped = flip(
        FramePose(np.zeros(3), np.array([0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]))
    )
    # x of the body is y of the world: y and z of the body change their signs
    matrix = protocol._rotation_matrix(flipped)
    expected = [[0, 1, 0], [1, 0, 0], [0, 0, -1]]
    np.testing.assert_allclose(matrix, expected, atol=1e-12)


def datagrams(*faults):
    """Ten datagrams of a sender, as values."""
    sender = PoseDatagrams(NAMES, DatagramOptions(rate=100.0, faults=faults))
    contents = []
    sender._send_frame = lambda content, now: contents.append(content)
    for step in range(10):
        sender.serve((step + 0.5) / 100, lambda: POSES)
    sender.close()
    return [json.loads(content) for content in contents]


def test_millimeters_end_when_the_fault_comes_again():
    found = datagrams("0 millimeters", "0.05 millimeters")
    heights = [one["bodies"]["base"]["position"][2] for one in found]
    assert heights == pytest.approx([100.0] * 5 + [0.1] * 5)


def test_one_emulator_serves_every_protocol():
    options = DatagramOptions(receiver=("127.0.0.1", 9))
    emulator = MocapEmulator(load_arm("twin_arm"), options, duration=0.1)
    emulator.run()
    assert emulator.server.frame_count > 1
    assert "JSON datagrams to 127.0.0.1" in emulator.server.label
