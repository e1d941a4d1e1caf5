"""Emulated Motive: options, faults, clients, the arm behind it."""

import socket
import threading

import numpy as np
import pytest
from streams import PATIENCE, free_port, wait_until

from s2c2a.arm import load_arm
from s2c2a.errors import S2C2AError
from s2c2a.lab.emulation import natnet_protocol as protocol
from s2c2a.lab.emulation.emulator import Emulator, EmulatorOptions
from s2c2a.lab.emulation.mocap import MocapEmulator, SlowMotion
from s2c2a.lab.emulation.mocap_server import GRAMMAR
from s2c2a.lab.emulation.motive import Motive, MotiveOptions
from s2c2a.lab.emulation.plant import FramePose
from s2c2a.lab.emulation.qtm import QtmOptions
from s2c2a.lab.emulation.tracked_bodies import to_stream
from s2c2a.lab.tracking import ModuleEnds, NatNetTracker

ARM = load_arm("twin_arm")
NAMES = ["base", "end-1"]
POSES = {name: FramePose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])) for name in NAMES}


@pytest.fixture
def client():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as opened:
        opened.bind(("127.0.0.1", 0))
        opened.settimeout(PATIENCE)
        yield opened


@pytest.fixture
def make_motive():
    opened = []

    def make(**options):
        port = free_port() + 1
        ports = {"command_port": port - 1, "data_port": port}
        motive = Motive(NAMES, MotiveOptions(**ports, **options))
        motive.open()
        opened.append(motive)
        return motive

    yield make
    for motive in opened:
        motive.close()


def ask(motive, client, kind, now=0.0):
    """Send a request; return the kinds of the messages that come back."""
    address = ("127.0.0.1", motive.options.command_port)
    client.sendto(protocol.pack(kind, b"\0"), address)
    motive.serve(now, lambda: POSES)
    return received(client)


def received(client):
    kinds = [protocol.unpack(client.recv(65_536))[0]]
    client.settimeout(0.05)
    try:
        while True:
            kinds.append(protocol.unpack(client.recv(65_536))[0])
    except TimeoutError:
        client.settimeout(PATIENCE)
        return kinds


@pytest.mark.parametrize(
    ("request_kind", "answers"),
    [
        (protocol.CONNECT, [protocol.SERVER_INFO, protocol.FRAME]),
        (protocol.REQUEST_DEFINITIONS, [protocol.DEFINITIONS]),
        (protocol.REQUEST, [protocol.UNRECOGNIZED]),
    ],
)
def test_a_request_has_its_answer(make_motive, client, request_kind, answers):
    assert ask(make_motive(), client, request_kind) == answers


def test_frames_wait_for_the_latency(make_motive, client):
    motive = make_motive(latency=0.5, rate=1.0)
    assert ask(motive, client, protocol.CONNECT) == [protocol.SERVER_INFO]
    motive.serve(0.6, lambda: POSES)
    assert received(client) == [protocol.FRAME]


def test_a_silent_client_is_forgotten(make_motive, client):
    motive = make_motive(rate=1.0)
    ask(motive, client, protocol.CONNECT)
    motive.serve(11.0, lambda: POSES)
    kinds = ask(motive, client, protocol.REQUEST_DEFINITIONS, now=12.5)
    assert kinds == [protocol.DEFINITIONS]


def test_during_a_restart_nobody_listens(make_motive, client):
    motive = make_motive(faults=("1 restart 2",))
    ask(motive, client, protocol.CONNECT)
    motive.serve(1.0, lambda: POSES)
    assert motive.files == []
    motive.serve(3.0, lambda: POSES)
    assert motive.frame_count == 1


def test_a_clock_drifts(make_motive):
    motive = make_motive(faults=("0 drift 1000",))
    motive.serve(0.0, lambda: POSES)
    assert motive.drift == pytest.approx(1e-3)


def test_a_taken_port_is_reported(make_motive):
    options = make_motive().options
    with pytest.raises(S2C2AError, match=str(options.command_port)):
        Motive(NAMES, options).open()


def test_with_y_up_the_height_is_the_second_coordinate():
    pose = FramePose(np.array([1.0, 2.0, 3.0]), np.array([0.1, 0.2, 0.3, 0.9]))
    streamed = to_stream(pose, "y")
    assert streamed.position.tolist() == [1.0, 3.0, -2.0]
    assert streamed.rotation.tolist() == [0.1, 0.3, -0.2, 0.9]


@pytest.mark.parametrize("text", ["1 hidden tip", "1 swapped base base"])
def test_a_fault_of_an_unknown_body_lists_the_bodies(text):
    with pytest.raises(S2C2AError, match="base, end-1"):
        GRAMMAR.parse((text,), NAMES)


@pytest.mark.parametrize(
    ("kind", "option"),
    [
        (MotiveOptions, {"version": "5.0"}),
        (MotiveOptions, {"up": "x"}),
        (MotiveOptions, {"rate": 0.0}),
        (MotiveOptions, {"noise": float("nan")}),
        (MotiveOptions, {"latency": -1.0}),
        (MotiveOptions, {"command_port": 0}),
        (MotiveOptions, {"multicast": "10.0.0.1"}),
        (QtmOptions, {"version": "2.0"}),
        (QtmOptions, {"port": 0}),
        (EmulatorOptions, {"pose_rate": 0.0}),
        (EmulatorOptions, {"firmware": 0}),
        (EmulatorOptions, {"duration": float("nan")}),
    ],
)
def test_invalid_options_are_refused(kind, option):
    with pytest.raises(S2C2AError, match="not allowed; give"):
        kind(**option)


def test_an_unknown_motion_is_refused():
    with pytest.raises(S2C2AError, match="none or babble"):
        MocapEmulator(ARM, MotiveOptions(), motion="dance")


def test_babbling_begins_slowly_and_repeats_with_its_seed():
    babbling = SlowMotion(ARM, seed=3)
    assert np.abs(babbling.goals(0.0)).max() == 0
    assert np.abs(babbling.goals(5.0)).max() > 1e-4
    np.testing.assert_array_equal(babbling.goals(5.0), SlowMotion(ARM, 3).goals(5.0))


def in_thread(emulator):
    """Start an emulator; returns its thread once it is ready."""
    ready = threading.Event()
    run = threading.Thread(target=emulator.run, args=(lambda *_: ready.set(),))
    run.start()
    assert ready.wait(PATIENCE)
    return run


@pytest.mark.parametrize("has_servos", [False, True])
def test_the_tracker_sees_the_states_of_a_straight_arm(has_servos, tmp_path):
    port = free_port() + 1
    motive = MotiveOptions(command_port=port - 1, data_port=port)
    emulator = MocapEmulator(ARM, motive, duration=PATIENCE)
    if has_servos:
        link = tmp_path / "port"
        options = EmulatorOptions(
            homed=True, link=link, mocap=motive, duration=PATIENCE
        )
        emulator = Emulator(ARM, options)
    run = in_thread(emulator)
    try:
        with NatNetTracker(command_port=port - 1, timeout=PATIENCE) as tracker:
            wait_until(lambda: tracker.latest() is not None)
            states = ModuleEnds.of(ARM.module_count).states(tracker.latest())
    finally:
        emulator.stop()
        run.join()
    tolerance = 2e-3 if has_servos else 1e-3
    np.testing.assert_allclose(states, emulator.plant.states(), atol=tolerance)
