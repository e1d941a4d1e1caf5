"""What passes the gate, and what does not."""

import msgspec
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from s2c2a.live.messages import is_sound

DRAG = {
    "type": "SceneNodeDragMessage",
    "phase": "update",
    "name": "/target",
    "instance_index": None,
    "start_position": [0, 0, 0.6],
    "start_screen_pos": [0.5, 0.5],
    "end_position": [0.1, 0.0, 0.5],
    "end_screen_pos": [0.6, 0.5],
    "button": "left",
    "modifier": None,
    "owner": "",
}
VALUE = {"type": "GuiUpdateMessage", "uuid": "a", "updates": {"value": 1.5}}


def packed(message) -> bytes:
    return msgspec.msgpack.encode(message)


def test_a_drag_and_a_new_value_pass():
    assert is_sound(packed(DRAG))
    assert is_sound(packed(VALUE))


@pytest.mark.parametrize(
    "message",
    [
        {"type": "ShareUrlRequest"},  # viser would open a tunnel to the world
        {
            "type": "FileTransferStartUpload",
            "source_component_uuid": "a",
            "transfer_uuid": "b",
        },
        {"type": "RunJavascriptMessage", "source": "alert(1)"},
        VALUE | {"updates": {"removed": True}},  # viser would set any attribute
        VALUE | {"updates": {"value": 1, "update_cb": []}},
        VALUE | {"updates": {"value": float("nan")}},
        VALUE | {"updates": {"value": {"deep": 1}}},
        DRAG | {"end_position": [float("inf"), 0, 0]},
        DRAG | {"end_position": [0, 0]},
        DRAG | {"phase": "never"},
        DRAG | {"extra": 1},
        {"type": "NoSuchMessage"},
        # nothing here is held or clicked
        {"type": "GuiButtonHoldMessage", "uuid": "a", "frequency": 10.0},
        [1, 2, 3],
        None,
    ],
)
def test_everything_else_is_refused(message):
    assert not is_sound(packed(message))


def test_text_and_long_messages_are_refused():
    assert not is_sound("text")
    assert not is_sound(packed(DRAG | {"name": "x" * 100_000}))


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.binary(max_size=200))
def test_random_bytes_are_refused(content):
    assert not is_sound(content)
