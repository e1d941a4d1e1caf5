"""Reader and emulator agree with the package qtm-rt."""

import asyncio
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from streams import POSES, qtm_streaming

from s2c2a.lab.emulation import qualisys_protocol
from s2c2a.lab.emulation.tracked_bodies import StreamedBody
from s2c2a.lab.tracking.qualisys.packets import (
    parse_frame,
    parse_parameters,
)

qtm_rt = pytest.importorskip("qtm_rt")
packet = pytest.importorskip("qtm_rt.packet")

BODIES = [StreamedBody(pose, name == "end-1") for name, pose in POSES.items()]


def test_frames_agree():
    content = qualisys_protocol.encode_frame(7, 1.5, BODIES)[8:]
    theirs = packet.QRTPacket(content)
    (lost, seen) = theirs.get_6d()[1]
    ours = parse_frame(content)
    assert (ours.number, ours.time) == (theirs.framenumber, theirs.timestamp * 1e-6)
    assert ours.bodies[0] is None
    assert np.isnan(lost[0]).all()
    np.testing.assert_array_equal(ours.bodies[1], [*seen[0], *seen[1].matrix])


async def first_frame(port):
    frames = asyncio.Queue()
    connection = await qtm_rt.connect("127.0.0.1", port=port, version="1.20")
    parameters = await connection.get_parameters(parameters=["3d", "6d"])
    await connection.stream_frames(components=["6d"], on_packet=frames.put_nowait)
    frame = await frames.get()
    connection.disconnect()
    return parameters, frame


def test_qtm_rt_reads_the_emulated_stream():
    # in a thread: another test may have left an event loop in this one
    with qtm_streaming() as (port, _), ThreadPoolExecutor(1) as thread:
        reading = asyncio.wait_for(first_frame(port), 20)
        parameters, frame = thread.submit(asyncio.run, reading).result()
    assert parse_parameters(parameters).names == tuple(POSES)
    (_, (position, rotation)) = frame.get_6d()[1]
    np.testing.assert_allclose(position, 1000 * POSES["end-1"].position)
    matrix = np.reshape(rotation.matrix, (3, 3)).T
    quarter_about_x = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    np.testing.assert_allclose(matrix, quarter_about_x, atol=1e-6)
