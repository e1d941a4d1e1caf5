"""Bags of ROS: topics become tables, which are joined by time."""

import numpy as np
import pytest

from s2c2a.logs import map_from_toml
from s2c2a.logs.errors import LogError, reading_as
from s2c2a.logs.reading import read_table
from s2c2a.logs.tables import ColumnRequest
from s2c2a.logs.take import build_take

rosbag2 = pytest.importorskip("rosbags.rosbag2")
typesys = pytest.importorskip("rosbags.typesys")

START = 1_700_000_000  # s since 1970
MAP = """
[rows]
kind = "timed"
time = "header.stamp"
topic = ["/joint_states", "/tip"]
[join]
by = "time"
files = 2
offset = [0.0]
[arm]
name = "a"
modules = 1
control_rate = 10
[[drives]]
measured = "position.0"
unit = "m"
[[drives]]
measured = "position.1"
unit = "m"
[[ends]]
position = ["pose.position.x", "pose.position.y", "pose.position.z"]
unit = "m"
"""


@pytest.fixture(params=["folder", ".db3", ".mcap"])
def bag(request, tmp_path):
    """A bag of 2 s with cables at 10 Hz and the tip at 25 Hz, a second before its clock."""
    store = typesys.get_typestore(typesys.Stores.LATEST)
    kinds = store.types
    folder = tmp_path / "walk"
    plugin = rosbag2.StoragePlugin
    storage = plugin.MCAP if request.param == ".mcap" else plugin.SQLITE3
    with rosbag2.Writer(folder, version=9, storage_plugin=storage) as writer:
        topics = {
            "/joint_states": "sensor_msgs/msg/JointState",
            "/tip": "geometry_msgs/msg/PoseStamped",
            "/words": "std_msgs/msg/String",
        }
        connections = {
            name: writer.add_connection(name, kind, typestore=store)
            for name, kind in topics.items()
        }

        def write(topic, seconds, **fields):
            stamp = kinds["builtin_interfaces/msg/Time"](
                START + int(seconds), round(1e9 * (seconds % 1.0))
            )
            header = kinds["std_msgs/msg/Header"](stamp, "base")
            message = kinds[topics[topic]](header=header, **fields)
            moment = round(1e9 * (START + 1 + seconds))
            raw = store.serialize_cdr(message, topics[topic])
            writer.write(connections[topic], moment, raw)

        for seconds in np.arange(20) / 10:
            position = np.array([0.01 * seconds, -0.01 * seconds])
            none = np.zeros(0)
            write(
                "/joint_states",
                seconds,
                name=["a", "b"],
                position=position,
                velocity=none,
                effort=none,
            )
        for seconds in np.arange(50) / 25:
            point = kinds["geometry_msgs/msg/Point"](0.1 * seconds, 0.0, 0.2)
            turn = kinds["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
            write("/tip", seconds, pose=kinds["geometry_msgs/msg/Pose"](point, turn))
    if request.param == "folder":
        return folder
    return next(folder.glob(f"*{request.param}"))


def test_two_topics_of_a_bag_are_joined_by_the_times_of_their_headers(bag):
    log_map = map_from_toml(MAP)
    requests = [
        ColumnRequest(log_map.number_columns, times=log_map.time_columns, topic=topic)
        for topic in log_map.rows.topic
    ]
    tables = [read_table(bag, request) for request in requests]
    take = build_take(tables, log_map)
    np.testing.assert_allclose(take.time[:2], [START, START + 0.1], rtol=0, atol=1e-6)
    seconds = take.time - START
    np.testing.assert_allclose(take.measured[:, 0], 0.01 * seconds, atol=1e-6)
    known = np.isfinite(take.positions[:, 0, 0])
    assert known.sum() > 17
    np.testing.assert_allclose(
        take.positions[known, 0, 0], 0.1 * seconds[known], atol=1e-6
    )


def test_a_bag_without_the_topic_lists_those_that_it_has(bag):
    request = ColumnRequest(["position.0"], topic="/joints")
    told = r"set rows\.topic to one of /joint_states, /tip"
    with pytest.raises(LogError, match=told):
        read_table(bag, request)


def test_times_of_recording_are_seconds_and_missing_fields_are_named(bag):
    table = read_table(bag, ColumnRequest(["time"], topic="/tip"))
    assert table.numbers["time"][0] == pytest.approx(START + 1, abs=1e-6)
    assert "time" in table.stamps
    with pytest.raises(LogError, match=r"it has .*pose\.position\.x"):
        read_table(bag, ColumnRequest(["x"], topic="/tip"))


def test_a_broken_bag_is_an_error(tmp_path):
    path = tmp_path / "walk.mcap"
    path.write_bytes(b"\x89MCAP0\r\n" + bytes(100))
    with pytest.raises(LogError, match="cut off: it ends after 0 whole messages"):
        read_table(path, ColumnRequest(["time"]))


def test_a_bag_of_ros_1_is_read_alike(tmp_path):
    rosbag1 = pytest.importorskip("rosbags.rosbag1")
    store = typesys.get_typestore(typesys.Stores.ROS1_NOETIC)
    path = tmp_path / "walk.bag"
    kind = "geometry_msgs/msg/PointStamped"
    kinds = store.types
    with rosbag1.Writer(path) as writer:
        connection = writer.add_connection("/tip", kind, typestore=store)
        for number in range(5):
            stamp = kinds["builtin_interfaces/msg/Time"](START + number, 5 * 10**8)
            header = kinds["std_msgs/msg/Header"](number, stamp, "base")
            point = kinds["geometry_msgs/msg/Point"](0.1 * number, 0.0, 0.2)
            message = kinds[kind](header=header, point=point)
            raw = store.serialize_ros1(message, kind)
            writer.write(connection, (START + number) * 10**9, raw)
    table = read_table(path, ColumnRequest(["header.stamp", "point.x"]))
    np.testing.assert_allclose(table.numbers["point.x"], 0.1 * np.arange(5))
    assert table.numbers["header.stamp"][1] == pytest.approx(START + 1.5, abs=1e-6)


def test_an_mcap_file_that_is_cut_off_says_how_much_is_whole(tmp_path):
    writer = pytest.importorskip("mcap.writer")
    path = tmp_path / "walk.mcap"
    with open(path, "wb") as file:
        out = writer.Writer(file, use_chunking=False)
        out.start()
        channel = out.register_channel("/a", "json", 0)
        for moment in range(10):
            out.add_message(channel, moment, b'{"a": 1}', moment)
        out.finish()
    content = path.read_bytes()
    path.write_bytes(content[: content.rindex(b'{"a": 1}') + 3])
    with pytest.raises(LogError, match="cut off: it ends after 9 whole messages"):
        read_table(path, ColumnRequest(["a"]))


def test_an_error_without_a_text_has_a_name():
    with (
        pytest.raises(LogError, match="cannot be read as MCAP: KeyError; look"),
        reading_as("a.mcap", "MCAP", "look"),
    ):
        raise KeyError
