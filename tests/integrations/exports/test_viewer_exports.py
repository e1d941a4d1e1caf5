"""Exports for viewers: what is written reads back equal with the formats' own readers."""

import json
from pathlib import Path

import numpy as np
import pytest

from s2c2a.arm import arm_from_toml
from s2c2a.cli.export import export
from s2c2a.cli.export_table import table_of
from s2c2a.integrations.scenes import scenes_of
from s2c2a.logs import import_logs, load_map
from s2c2a.logs.errors import LogError
from s2c2a.logs.reading import read_table
from s2c2a.logs.tables import ColumnRequest

TARGET = [0.1, 0.0, 0.5]
OBSTACLE = [0.3, 0.1, 0.4, 0.05]


@pytest.fixture(scope="module")
def mcap_file(recording):
    pytest.importorskip("foxglove")
    out = recording.with_suffix(".mcap")
    export(recording, out)
    return out


def messages_of(path):
    """Times and contents of the messages of each topic, decoded by their schemas."""
    reader = pytest.importorskip("mcap.reader")
    messages = {}
    with open(path, "rb") as file:
        for schema, channel, message in reader.make_reader(file).iter_messages():
            content = message.data
            if channel.message_encoding == "json":
                content = json.loads(content)
            else:
                content = decoded(schema, content)
            messages.setdefault(channel.topic, []).append((message.log_time, content))
    return messages


def decoded(schema, content):
    """A message of Protobuf, by the description of its schema in the file."""
    pytest.importorskip("google.protobuf")
    from google.protobuf import (  # noqa: PLC0415  # no extra of ours
        descriptor_pb2,
        descriptor_pool,
        message_factory,
    )

    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(schema.data).file:
        pool.Add(file)
    kind = message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name))
    return kind.FromString(content)


def test_a_center_line_ends_at_the_tip_and_goes_on_where_an_end_is_lost(episodes):
    scenes = list(scenes_of(episodes))
    whole = scenes[len(episodes[0])]
    tip = episodes[1].sensor("states")[0, -1, :3]
    np.testing.assert_allclose(whole.line[-1], tip)
    assert (whole.line[0] == 0).all()
    lost = scenes[len(episodes[0]) + 3]
    assert np.isfinite(lost.line).all()
    assert np.isnan(lost.numbers["sensor.states.2.x"])
    assert list(scenes[-1].targets) == [3]
    assert not len(scenes[0].obstacles)


def test_messages_of_foxglove_hold_frames_scene_and_cables(mcap_file, episodes):
    messages = messages_of(mcap_file)
    times = table_of(episodes)["log_time"]
    moments = [moment for moment, _ in messages["/tf"]]
    np.testing.assert_allclose(moments, times * 1e9, atol=1)
    row = len(episodes[0])
    base, *ends = messages["/tf"][row][1].transforms
    assert (base.parent_frame_id, base.child_frame_id) == ("world", "base")
    for end, state in zip(ends, episodes[1].sensor("states")[0], strict=True):
        place = end.translation
        np.testing.assert_allclose([place.x, place.y, place.z], state[:3])
    commands = [joint.position for joint in messages["/commands"][row][1].joints]
    np.testing.assert_allclose(commands, episodes[1]["actions"][0].ravel())
    entities = {each.id: each for each in messages["/scene"][-1][1].entities}
    place = entities["targets"].spheres[0].pose.position
    np.testing.assert_allclose([place.x, place.y, place.z], TARGET)
    corners = entities["obstacles"].triangles[0].points
    distances = [
        np.linalg.norm(np.subtract([each.x, each.y, each.z], OBSTACLE[:3]))
        for each in corners
    ]
    np.testing.assert_allclose(distances, OBSTACLE[3])
    assert len(entities["arm"].lines[0].points) == 16


def test_steps_hold_all_numbers_and_null_for_missing_ones(mcap_file, episodes):
    steps = messages_of(mcap_file)["/step"]
    table = table_of(episodes)
    assert len(steps) == len(table["time"])
    for name, values in table.items():
        read = [step[name.replace(".", "_")] for _, step in steps]
        np.testing.assert_array_equal(np.array(read, float), values)
    assert steps[len(episodes[0]) + 3][1]["sensor_states_2_x"] is None


def test_an_mcap_file_keeps_the_arm_and_a_layout(mcap_file, episodes):
    reader = pytest.importorskip("mcap.reader")
    with open(mcap_file, "rb") as file:
        (metadata,) = reader.make_reader(file).iter_metadata()
    assert arm_from_toml(metadata.metadata["arm"], "arm") == episodes[0].arm
    layout = json.loads(Path(f"{mcap_file}.layout.json").read_text())
    shown = {layout["layout"]["first"], *layout["layout"]["second"].values()}
    assert shown > set(layout["configById"])
    paths = [path["value"] for path in layout["configById"]["Plot!tip"]["paths"]]
    assert paths[0] == "/step.sensor_states_3_x"


@pytest.mark.slow
def test_an_exported_mcap_file_is_imported_with_the_same_rows(mcap_file, episodes):
    log_map = load_map(f"{mcap_file}.map.toml")
    assert log_map.rows.topic == "/step"
    request = ColumnRequest(
        log_map.number_columns, log_map.label_columns, topic=log_map.rows.topic
    )
    table = read_table(mcap_file, request)
    known = table_of(episodes)
    for name, values in known.items():
        if name.replace(".", "_") in log_map.number_columns:
            read = table.numbers[name.replace(".", "_")]
            np.testing.assert_array_equal(read, values)
    imported = import_logs([mcap_file], log_map)
    assert len(imported.episodes) == 2


def test_topics_that_are_not_json_are_named(mcap_file):
    with pytest.raises(LogError, match=r"'/tf', whose messages are protobuf; .*/step"):
        read_table(mcap_file, ColumnRequest(["time"], topic="/tf"))
