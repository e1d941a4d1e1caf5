"""Whatever a browser says within the gate's rules, the next driver has a whole panel."""

import time

import msgspec
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from test_gate import CAMERA, browser  # type: ignore[import-not-found]
from websockets.exceptions import ConnectionClosed

from s2c2a.live.request import SPEED, WEIGHTS, Request, RequestLimits, faults
from s2c2a.spaces import Stage

from live_tabs import until  # type: ignore[import-not-found]

NUMBERS = st.floats(-1e300, 1e300) | st.integers(-(2**63), 2**63 - 1)
VALUES = (
    NUMBERS
    | st.text(max_size=8)
    | st.booleans()
    | st.lists(st.floats(-9, 9), max_size=4)
)
POINTS = st.tuples(*[st.floats(-1e9, 1e9)] * 3)
DRAGS = st.fixed_dictionaries(
    {
        "type": st.just("SceneNodeDragMessage"),
        "phase": st.sampled_from(["start", "update", "end"]),
        "name": st.sampled_from(
            ["/target", "/pointer", "/obstacles/0/threshold", "/arm/0", "/nothing", ""]
        ),
        "instance_index": st.none() | st.integers(-3, 3),
        "start_position": POINTS,
        "start_screen_pos": st.tuples(NUMBERS, NUMBERS),
        "end_position": POINTS,
        "end_screen_pos": st.tuples(NUMBERS, NUMBERS),
        "button": st.sampled_from(["left", "right"]),
        "modifier": st.none() | st.text(max_size=3),
        "owner": st.sampled_from(["", "1"]),
    }
)
CAMERAS = st.fixed_dictionaries(
    {name: NUMBERS.map(float) for name in ("fov", "near", "far")}
    | {"position": POINTS, "look_at": POINTS}
).map(lambda drawn: CAMERA | drawn)
MESSAGES = st.tuples(st.integers(0, 60), VALUES) | DRAGS | CAMERAS


# labels of buttons that say what is on
TOGGLED = {"Pause": "Play", "Stop recording": "Record"}


def parts_of(page):
    """All parts of the panel of whoever drives, by number, once it is built."""
    until(lambda: page.session.driver is not None, what="a driver")
    panel = page._panels[page.session.driver]
    until(lambda: panel._role is not None, what="a panel")
    with panel._building:
        return dict(panel._gui._gui_input_handle_from_uuid)


def labels_of(parts) -> list[str]:
    """What is on a panel, whatever is on."""
    return sorted(TOGGLED.get(part.label, part.label) for part in parts.values())


def message(drawn, uuids):
    """One that passes the gate; a pair is a value of a part that is there, or of none."""
    if not isinstance(drawn, tuple):
        return drawn
    number, value = drawn
    return {
        "type": "GuiUpdateMessage",
        "uuid": uuids[number] if number < len(uuids) else "none",
        "updates": {"value": value},
    }


@settings(max_examples=12, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.lists(MESSAGES, min_size=10, max_size=60))
def test_whatever_one_driver_says_the_next_one_has_a_whole_panel(control, page, drawn):
    with browser(page) as first:
        first.send(msgspec.msgpack.encode(CAMERA))
        parts = parts_of(page)
        labels = labels_of(parts)
        try:
            for one in drawn:
                first.send(msgspec.msgpack.encode(message(one, list(parts))))
        except ConnectionClosed:
            pass
        time.sleep(0.1)
    until(lambda: page.session.driver is None, what="going")
    drawn_before = page.frames
    with browser(page) as second:
        second.send(msgspec.msgpack.encode(CAMERA))
        assert labels_of(parts_of(page)) == labels
        until(lambda: page.frames > drawn_before + 2, what="drawing")
    until(lambda: page.session.driver is None, what="going")
    assert control.latest.stage is not Stage.FAULT


@settings(suppress_health_check=list(HealthCheck))
@given(st.floats(-1e12, 1e12))
def test_a_knob_shows_what_is_within_its_ends_whatever_was_asked(twin, number):
    limits = RequestLimits.of(twin, ())
    for knob in (SPEED, *WEIGHTS, *faults(limits, couples=True)):
        asked = limits.changed(Request(), **knob.change(Request(), number))
        assert knob.low <= knob.shown(asked) <= knob.high
