"""The next driver gets a complete panel, whatever valid messages the last one sent."""

import time

import msgspec
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from test_gate import CAMERA, driving  # type: ignore[import-not-found]
from websockets.exceptions import ConnectionClosed

from s2c2a.live.request import (
    SPEED_SLIDER,
    WEIGHT_SLIDERS,
    Obstacle,
    Request,
    RequestLimits,
    fault_sliders,
)
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
).map(lambda values: CAMERA | values)
MESSAGES = st.tuples(st.integers(0, 60), VALUES) | DRAGS | CAMERAS

# labels that buttons have while something runs
TOGGLED = {"Pause": "Play", "Stop recording": "Record"}


def elements_of(page):
    """Elements of the driver's panel by id, once it is built."""
    until(lambda: page.browsers.driver is not None, what="a driver")
    panel = page._panels[page.browsers.driver]
    until(lambda: panel._role is not None, what="a panel")
    with panel._building:
        return dict(panel._gui._gui_input_handle_from_uuid)


def labels_of(elements) -> list[str]:
    """Labels of a panel while nothing runs."""
    labels = [element.label for element in elements.values()]
    return sorted(TOGGLED.get(label, label) for label in labels)


def message(sample, uuids):
    """A valid message; a pair is the number of an element and its new value."""
    if not isinstance(sample, tuple):
        return sample
    number, value = sample
    return {
        "type": "GuiUpdateMessage",
        "uuid": uuids[number] if number < len(uuids) else "none",
        "updates": {"value": value},
    }


@pytest.mark.slow
@settings(max_examples=12, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.lists(MESSAGES, min_size=10, max_size=60))
def test_the_next_driver_has_a_complete_panel(control, page, samples):
    with driving(page) as first:
        elements = elements_of(page)
        labels = labels_of(elements)
        try:
            for sample in samples:
                encoded = msgspec.msgpack.encode(message(sample, list(elements)))
                first.send(encoded)
        except ConnectionClosed:
            pass
        time.sleep(0.1)
    until(lambda: page.browsers.driver is None, what="disconnecting")
    frames = page.frames
    with driving(page):
        assert labels_of(elements_of(page)) == labels
        until(lambda: page.frames > frames + 2, what="drawing")
    until(lambda: page.browsers.driver is None, what="disconnecting")
    assert control.latest.stage is not Stage.FAULT


@settings(suppress_health_check=list(HealthCheck))
@given(st.floats(-1e12, 1e12))
def test_a_slider_stays_within_its_ends_for_any_request(twin, number):
    limits = RequestLimits.of(twin, ())
    sliders = (SPEED_SLIDER, *WEIGHT_SLIDERS, *fault_sliders(limits, coupled=True))
    for slider in sliders:
        request = limits.changed(Request(), **slider.change(Request(), number))
        assert slider.low <= slider.value(request) <= slider.high


def update(uuid, value) -> bytes:
    """The message of an element that a user changes or presses."""
    updates = {"value": value}
    typed = {"type": "GuiUpdateMessage", "uuid": uuid, "updates": updates}
    return msgspec.msgpack.encode(typed)


def test_a_typed_target_is_set_by_its_button_and_its_field_follows(control, page):
    with driving(page) as tab:
        elements = elements_of(page)
        uuids = {element.label: uuid for uuid, element in elements.items()}
        control.ask(task=None, target=(0.1, 0.0, 0.5))
        field = elements[uuids["Target [cm]"]]
        until(lambda: field.value == (10.0, 0.0, 50.0), what="the field")
        tab.send(update(uuids["Target [cm]"], [10.0, -1.0, 50.0]))
        tab.send(update(uuids["Target [cm]"], [10.0, -12.5, 50.0]))
        until(lambda: field.value == (10.0, -12.5, 50.0), what="typing")
        frames = page.frames
        until(lambda: page.frames > frames + 20, what="drawing")
        assert field.value == (10.0, -12.5, 50.0)
        assert control.request.target == (0.1, 0.0, 0.5)
        tab.send(update(uuids["Set target"], True))
        until(lambda: control.request.target == (0.1, -0.125, 0.5), what="the target")
    until(lambda: page.browsers.driver is None, what="disconnecting")


def test_every_obstacle_is_typed_and_the_others_stay_exactly(control, page):
    with driving(page) as tab:
        elements = elements_of(page)
        uuids = {element.label: uuid for uuid, element in elements.items()}
        first = Obstacle((0.30001, 0.0, 0.2), 0.05)
        second = Obstacle((0.0, 0.30001, 0.2), 0.06)
        control.ask(obstacles=(first, second))
        field = elements[uuids["Obstacle 1 [cm]"]]
        until(lambda: field.value == (30.0, 0.0, 20.0), what="the field")
        tab.send(update(uuids["Obstacle 1 [cm]"], [35.5, 0.0, 20.0]))
        tab.send(update(uuids["Set obstacles"], True))
        moved = Obstacle((0.355, 0.0, 0.2), 0.05)
        until(lambda: control.request.obstacles == (moved, second), what="the obstacle")
        assert elements[uuids["Obstacle 2 [cm]"]].visible
        assert not elements[uuids["Obstacle 3 [cm]"]].visible
        control.ask(obstacles=())
        until(lambda: not field.visible, what="hiding")
    until(lambda: page.browsers.driver is None, what="disconnecting")
