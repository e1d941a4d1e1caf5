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


def test_a_datagram_gives_time_frame_and_seen_bodies():
    datagram = parse_datagram(encoded(), ARRIVAL)
    assert (datagram.source_time, datagram.number) == (1.5, 7)
    assert list(datagram.poses) == ["base"]
    np.testing.assert_array_equal(datagram.poses["base"].position, [0.1, 0.2, 0.3])


def test_millimeters_become_meters():
    body = BODY | {"position": [1, 2, 3000]}
    datagram = parse_datagram(encoded(bodies={"base": body}, units="mm"), ARRIVAL)
    np.testing.assert_allclose(datagram.poses["base"].position, [0.001, 0.002, 3.0])


MALFORMED = [
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
]
IMPLAUSIBLE = [
    encoded(time=float("nan")),
    encoded(time=float("inf")),
    encoded(bodies={"base": BODY | {"position": [0, 0, 101]}}),
    encoded(bodies={"base": BODY | {"position": [0, 0, float("-inf")]}}),
    encoded(bodies={"base": BODY | {"rotation": [0, 0, 0, 0.98]}}),
    encoded(bodies={"base": BODY | {"rotation": [0, 0, 0, 0]}}),
    encoded(bodies={"base": BODY | {"rotation": [1e308, 1e308, 0, 1]}}),
]
OVERSIZED = [encoded() + b" " * MAX_BYTES]


@pytest.mark.parametrize(
    ("reason", "content"),
    [
        *[(DropReason.MALFORMED, content) for content in MALFORMED],
        *[(DropReason.IMPLAUSIBLE, content) for content in IMPLAUSIBLE],
        *[(DropReason.OVERSIZED, content) for content in OVERSIZED],
    ],
)
def test_a_bad_datagram_is_dropped_with_its_reason(reason, content):
    with pytest.raises(DatagramError) as caught:
        parse_datagram(content, ARRIVAL)
    assert caught.value.reason is reason


DATAGRAMS = st.one_of(
    JSON,
    st.builds(
        lambda key, value: message(**{key: value}),
        st.sampled_from(["time", "frame", "bodies", "units", "more"]),
        JSON,
    ),
    st.builds(
        lambda key, value: message(bodies={"base": BODY | {key: value}}),
        st.sampled_from(["position", "rotation", "more"]),
        JSON,
    ),
)


@given(DATAGRAMS)
def test_any_json_is_dropped_or_valid(value):
    with suppress(DatagramError):
        assert is_valid(parse_datagram(json.dumps(value).encode(), ARRIVAL))


def after_first(by_time, frame, time, arrival=100.01, sender="a"):
    """Restarts that an order counts when a frame follows frame 10 of 5 s at 100 s."""
    order = FrameOrder(by_time)
    order.accept(PoseFrame(100.0, 5.0, 10, {}), "a")
    order.accept(PoseFrame(arrival, time, frame, {}), sender)
    return order.restarts


@pytest.mark.parametrize(
    ("frame", "restarts"),
    [
        ((False, 11, 5.01), 0),  # the next frame
        ((False, 11, 5.0), 0),  # a coarse clock of the source
        ((False, 50, 9.0, 104.0), 0),  # after lost frames
        ((False, 0, 0.0, 101.1), 1),  # a restart after a silence
        ((False, 0, 0.0, 101.1, "b"), 1),  # by another process
        ((False, 0, 99.0, 101.1, "b"), 1),  # with the time of day
        ((False, 10, 0.1, 101.1), 1),  # with the same number by chance
        ((False, 0, 3.9), 1),  # a reset of clock and numbers
        # frames that are not counted
        ((True, 10, 5.01), 0),  # a number that never changes
        ((True, 3, 5.01), 0),  # numbers that begin again
        ((True, 11, 5.0), 0),  # a coarse clock
        ((True, 10, 0.0), 1),  # a reset of the clock
    ],
)
def test_a_newer_frame_or_a_restart_is_accepted(frame, restarts):
    assert after_first(*frame) == restarts


@pytest.mark.parametrize(
    ("frame", "reason"),
    [
        ((False, 10, 5.0), "DUPLICATE"),
        ((False, 10, 5.0, 200.0), "DUPLICATE"),
        ((False, 10, 5.01), "DUPLICATE"),
        ((False, 9, 4.99), "LATE"),
        ((False, 9, 5.01), "LATE"),
        ((False, 11, 4.99), "LATE"),
        ((False, 11, 1.0), "LATE"),
        ((False, 0, 4.5, 100.9), "LATE"),
        ((False, 11, 5.01, 100.01, "b"), "OTHER_SENDER"),
        ((True, 10, 5.0), "DUPLICATE"),
        ((True, 10, 4.99), "LATE"),
        ((True, 11, 4.99), "LATE"),
        ((True, 9, 5.0), "LATE"),
    ],
)
def test_an_old_frame_is_dropped(frame, reason):
    with pytest.raises(DatagramError) as caught:
        after_first(*frame)
    assert caught.value.reason is DropReason[reason]


def test_a_dropped_frame_does_not_prolong_the_silence():
    order = FrameOrder()
    order.accept(PoseFrame(100.0, 5.0, 10, {}), "a")
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
