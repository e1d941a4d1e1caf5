"""Serial line on a pseudo-terminal."""

import os
import sys
import termios

import pytest
from serial import Serial

from s2c2a.errors import S2C2AError
from s2c2a.lab.emulation.instructions import Reply
from s2c2a.lab.emulation.line import Line


@pytest.fixture
def line(tmp_path):
    line = Line(tmp_path / "port", 1_000_000)
    line.plug()
    yield line
    line.unplug()


@pytest.fixture
def user(line):
    file = os.open(line.link, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    yield file
    os.close(file)


def set_baud_rate(file, speed):
    attributes = termios.tcgetattr(file)
    attributes[4:6] = [speed, speed]
    termios.tcsetattr(file, termios.TCSANOW, attributes)


def test_bytes_pass_unchanged_in_both_directions(line, user):
    data = bytes(range(256))
    os.write(user, data)
    assert line.receive() == data
    line.queue([Reply(1, data, 0.0)])
    line.transmit(1.0)
    assert os.read(user, 1000) == data


def test_an_answer_waits_for_the_wire(line, user):
    line.occupy(14, 5.0)
    line.queue([Reply(1, bytes(15), 0.0005), Reply(2, bytes(15), 0.0)])
    assert line.next_time == pytest.approx(5.0 + 290e-6 + 500e-6)
    line.transmit(5.0007)
    assert line.next_time < 5.0008
    line.transmit(5.0008)
    assert line.next_time == pytest.approx(5.0 + 440e-6 + 500e-6)


def test_a_slower_line_takes_longer(line, user):
    set_baud_rate(user, termios.B57600)
    line.occupy(10, 0.0)
    line.queue([Reply(1, bytes(10), 0.0)])
    assert line.next_time == pytest.approx(200 / 57_600)


def test_the_baud_rate_is_unknown_until_the_user_sets_it(line, user):
    assert line.user_baud_rate() is None
    set_baud_rate(user, termios.B1000000)
    assert line.user_baud_rate() == 1_000_000


def test_a_lost_answer_leaves_its_gap(line):
    line.queue([Reply(1, b"", 0.0), Reply(2, bytes(10), 0.0)])
    assert line.next_time == pytest.approx(100e-6)


def test_an_unplugged_port_fails_and_returns_under_its_name(line):
    before = os.open(line.link, os.O_RDWR | os.O_NOCTTY)
    line.unplug()
    assert not line.link.exists()
    with pytest.raises(OSError, match="error"):
        os.write(before, b"x")
    os.close(before)
    line.plug()
    after = os.open(line.link, os.O_RDWR | os.O_NOCTTY)
    os.write(after, b"x")
    assert line.receive() == b"x"
    os.close(after)


def test_a_user_may_leave_and_return(line):
    for data in (b"first", b"second"):
        file = os.open(line.link, os.O_RDWR | os.O_NOCTTY)
        os.write(file, data)
        assert line.receive() == data
        os.close(file)
        assert line.receive() == b""


def test_a_file_in_place_of_the_link_is_kept(tmp_path):
    path = tmp_path / "port"
    path.write_text("precious")
    with pytest.raises(S2C2AError, match="no symbolic link"):
        Line(path, 1_000_000).plug()
    assert path.read_text() == "precious"


@pytest.mark.skipif(sys.platform != "linux", reason="sets a speed as Linux does")
def test_a_baud_rate_without_a_constant_is_recognized(line):
    with Serial(str(line.link), 4_500_000):
        assert line.user_baud_rate() == 4_500_000
