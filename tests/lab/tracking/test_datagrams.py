"""Datagrams are parsed strictly, and frames never go back."""

import json
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from s2c2a.lab.tracking.datagrams import (
    MAX_BYTES,
    DatagramError,
    DropReason,
    FrameOrder,
    parse_datagram,
)
from s2c2a.lab.tracking.tracker import PoseFrame

ARRIVAL = 100.0  # s
BODY = {"position": [0.1, 0.2, 0.3], "rotation": [0.0, 0.0, 0.0, 1.0]}
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(
            st.sampled_from(["time", "frame", "bodies", "position", "rotation", "a"]),
            inner,
        )
    ),
    max_leaves=12,
)


def message(**changes):
    return {"time": 1.5, "frame": 7, "bodies": {"base": BODY, "end-1": None}} | changes


def encoded(**changes):
    return json.dumps(message(**changes)).encode()


def drop_reason(content):
    with pytest.raises(DatagramError) as caught:
        parse_datagram(content, ARRIVAL)
    return caught.value.reason


def is_valid(datagram):
    """Whether an accepted datagram holds only what the format allows."""
    poses = datagram.poses.values()
    numbers = [datagram.source_time, *(np.abs(pose.position).max() for pose in poses)]
    lengths = [np.linalg.norm(pose.rotation) for pose in poses]
    return (
        np.isfinite(numbers).all()
        and max(numbers[1:], default=0.0) <= 100
        and np.allclose(lengths, 1.0, atol=1e-12)
        and type(datagram.number) is int
        and 0 <= datagram.number < 2**63
    )


def check(content):
    """A datagram is valid, or dropped."""
    with suppress(DatagramError):
        assert is_valid(parse_datagram(content, ARRIVAL)), content


def test_a_datagram_gives_time_frame_and_seen_bodies():
    datagram = parse_datagram(encoded(), ARRIVAL)
    assert (datagram.source_time, datagram.number) == (1.5, 7)
    assert list(datagram.poses) == ["base"]
    np.testing.assert_array_equal(datagram.poses["base"].position, [0.1, 0.2, 0.3])


def test_millimeters_become_meters():
    body = BODY | {"position": [1, 2, 3000]}
    datagram = parse_datagram(encoded(bodies={"base": body}, units="mm"), ARRIVAL)
    np.testing.assert_allclose(datagram.poses["base"].position, [0.001, 0.002, 3.0])


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"null",
        b"[]",
        b"\xff\xfe",
        b"[" * 10_000,
        b'{"a":' * 3000,
        b"9" * 10_000,
        encoded(frame=1.0),
        encoded(frame=True),
        encoded(frame=-1),
        encoded(frame=2**63),
        encoded(time="1"),
        encoded(time=True),
        encoded(time=None),
        encoded(bodies=[]),
        encoded(bodies={"base": {}}),
        encoded(bodies={"": BODY}),
        encoded(bodies={"base": BODY | {"position": [0, 0]}}),
        encoded(bodies={"base": BODY | {"rotation": [0, 0, 0, 1, 0]}}),
        encoded(bodies={"base": BODY | {"position": [0, 0, "1"]}}),
        encoded(units="cm"),
        encoded(unit="mm"),
        encoded()[:-1],
        b'{"time": 1, "time": 2, "frame": 1, "bodies": {}}',
    ],
)
def test_a_malformed_datagram_is_dropped_as_such(content):
    assert drop_reason(content) is DropReason.MALFORMED


@pytest.mark.parametrize(
    "content",
    [
        encoded(time=float("nan")),
        encoded(time=float("inf")),
        encoded(bodies={"base": BODY | {"position": [0, 0, 101]}}),
        encoded(bodies={"base": BODY | {"position": [0, 0, float("-inf")]}}),
        encoded(bodies={"base": BODY | {"rotation": [0, 0, 0, 0.98]}}),
        encoded(bodies={"base": BODY | {"rotation": [0, 0, 0, 0]}}),
        encoded(bodies={"base": BODY | {"rotation": [1e308, 1e308, 0, 1]}}),
    ],
)
def test_an_implausible_datagram_is_dropped_as_such(content):
    assert drop_reason(content) is DropReason.IMPLAUSIBLE


def test_an_oversized_datagram_is_dropped_before_it_is_parsed():
    assert drop_reason(encoded() + b" " * MAX_BYTES) is DropReason.OVERSIZED


@given(JSON)
def test_any_json_is_dropped_or_valid(value):
    check(json.dumps(value).encode())


@given(JSON, st.sampled_from(["time", "frame", "bodies", "units", "more"]))
def test_any_value_of_a_key_is_dropped_or_valid(value, key):
    check(encoded(**{key: value}))


@given(JSON, st.sampled_from(["position", "rotation", "more"]))
def test_any_value_of_a_body_is_dropped_or_valid(value, key):
    check(encoded(bodies={"base": BODY | {key: value}}))


def order_with(frame=10, time=5.0, arrival=100.0):
    order = FrameOrder()
    order.accept(PoseFrame(arrival, time, frame, {}), "a")
    return order


@pytest.mark.parametrize(
    ("frame", "time", "arrival", "sender"),
    [
        (11, 5.01, 100.01, "a"),  # the next frame
        (11, 5.0, 100.01, "a"),  # a coarse clock of the source
        (50, 9.0, 104.0, "a"),  # after lost frames
        (0, 0.0, 101.1, "a"),  # a restart after a silence
        (0, 0.0, 101.1, "b"),  # by another process
        (0, 99.0, 101.1, "b"),  # with the time of day
        (10, 0.1, 101.1, "a"),  # with the same number by chance
        (0, 3.9, 100.01, "a"),  # a reset of clock and numbers
    ],
)
def test_a_newer_frame_or_a_restart_is_accepted(frame, time, arrival, sender):
    order = order_with()
    order.accept(PoseFrame(arrival, time, frame, {}), sender)
    assert order.restarts == int(frame <= 10)


@pytest.mark.parametrize(
    ("frame", "time", "arrival", "sender", "reason"),
    [
        (10, 5.0, 100.01, "a", DropReason.DUPLICATE),
        (10, 5.0, 200.0, "a", DropReason.DUPLICATE),
        (10, 5.01, 100.01, "a", DropReason.DUPLICATE),
        (9, 4.99, 100.01, "a", DropReason.LATE),
        (9, 5.01, 100.01, "a", DropReason.LATE),
        (11, 4.99, 100.01, "a", DropReason.LATE),
        (11, 1.0, 100.01, "a", DropReason.LATE),
        (0, 4.5, 100.9, "a", DropReason.LATE),
        (11, 5.01, 100.01, "b", DropReason.OTHER_SENDER),
    ],
)
def test_an_old_frame_is_dropped(frame, time, arrival, sender, reason):
    order = order_with()
    with pytest.raises(DatagramError) as caught:
        order.accept(PoseFrame(arrival, time, frame, {}), sender)
    assert caught.value.reason is reason
    assert order.restarts == 0


def timed_order():
    order = FrameOrder(by_time=True)
    order.accept(PoseFrame(100.0, 5.0, 10, {}), "a")
    return order


@pytest.mark.parametrize(
    ("frame", "time", "restarts"),
    [
        (10, 5.01, 0),  # a number that never changes
        (3, 5.01, 0),  # numbers that begin again
        (11, 5.0, 0),  # a coarse clock
        (10, 0.0, 1),  # a reset of the clock
    ],
)
def test_the_time_alone_decides_where_frames_are_not_counted(frame, time, restarts):
    order = timed_order()
    order.accept(PoseFrame(100.01, time, frame, {}), "a")
    assert order.restarts == restarts


@pytest.mark.parametrize(
    ("frame", "time", "reason"),
    [
        (10, 5.0, DropReason.DUPLICATE),
        (10, 4.99, DropReason.LATE),
        (11, 4.99, DropReason.LATE),
        (9, 5.0, DropReason.LATE),
    ],
)
def test_frames_that_are_not_counted_are_dropped_by_their_time(frame, time, reason):
    with pytest.raises(DatagramError) as caught:
        timed_order().accept(PoseFrame(100.01, time, frame, {}), "a")
    assert caught.value.reason is reason


def test_a_dropped_frame_does_not_prolong_the_silence():
    order = order_with()
    with pytest.raises(DatagramError):
        order.accept(PoseFrame(100.9, 4.9, 0, {}), "a")
    order.accept(PoseFrame(101.1, 5.1, 1, {}), "a")
    assert order.restarts == 1


@given(st.lists(st.tuples(st.integers(0, 5), st.floats(0, 3)), max_size=30))
def test_frames_in_quick_order_only_go_back_at_a_restart(frames):
    order = FrameOrder()
    last = None
    for arrival, (frame, time) in enumerate(frames):
        restarts = order.restarts
        try:
            order.accept(PoseFrame(0.01 * arrival, time, frame, {}), "a")
        except DatagramError:
            continue
        grew = last is None or (frame > last[0] and time >= last[1])
        assert grew == (order.restarts == restarts)
        last = (frame, time)
