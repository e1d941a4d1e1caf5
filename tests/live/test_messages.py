"""Messages that pass the gate, and messages that are refused."""

import msgspec
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from s2c2a.live.messages import is_valid

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


def test_drags_and_new_values_pass():
    assert is_valid(packed(DRAG))
    assert is_valid(packed(VALUE))


@pytest.mark.parametrize(
    "message",
    [
        {"type": "ShareUrlRequest"},  # viser would open a public tunnel
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
        # the page has no buttons that repeat while held
        {"type": "GuiButtonHoldMessage", "uuid": "a", "frequency": 10.0},
        [1, 2, 3],
        None,
    ],
)
def test_all_other_messages_are_refused(message):
    assert not is_valid(packed(message))


def test_text_and_long_messages_are_refused():
    assert not is_valid("text")
    assert not is_valid(packed(DRAG | {"name": "x" * 100_000}))


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.binary(max_size=200))
def test_random_bytes_are_refused(content):
    assert not is_valid(content)
