"""Bags of ROS 1 and ROS 2, and MCAP files of ROS 2: one topic is one table.

Only standard messages are decoded. Definitions that a bag brings would be compiled to
code, and files of strangers run none.
"""

import os
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from s2c2a.logs.errors import MAX_BYTES, MAX_COLUMNS, LogError, needs_extra, reading_as
from s2c2a.logs.tables import ColumnRequest, Table, TableBuilder, list_names

TIME = "time"
"""Column of the times at which messages were recorded [s]."""
STAMP = "header.stamp"
"""Column of the times in the messages' headers [s]."""
NANOSECOND = 1e-9  # s
READ_SIZE = 1_000_000  # bytes at a time


def read_bag(path: str | os.PathLike, request: ColumnRequest) -> Table:
    """Read one topic of a bag: a folder, or a file ending in .bag, .db3 or .mcap.

    Fields are named `pose.position.x` and `position.0`; `time` and `header.stamp` are
    in seconds since 1970.

    Raises:
        LogError: the package is missing, the bag cannot be read or is too large, the
            topic is not one of its own, or its messages are no standard ones.
    """
    is_first = Path(path).suffix.lower() == ".bag"
    with needs_extra(path, "rosbag or MCAP"):
        from rosbags import rosbag1, rosbag2  # noqa: PLC0415  # an extra

        _check_size(Path(path))
    reader = rosbag1.Reader if is_first else rosbag2.Reader
    with (
        reading_as(
            path,
            "a bag",
            "check that it is complete (`ros2 bag info`), or export its topics as CSV",
        ),
        reader(Path(path)) as bag,
    ):
        topic = _topic_of(path, bag.topics, request.topic)
        rows = _rows_of(bag, topic, is_first)
        return table_of_rows(path, rows, request)


def _check_size(path: Path) -> None:
    """Refuse a folder that is too large; compressed files are unpacked to the disk."""
    size = sum(map(_unpacked_size, path.iterdir() if path.is_dir() else ()))
    if size > MAX_BYTES:
        raise LogError(
            f"{path} unpacks to more than {MAX_BYTES} bytes. Record the topics of the arm "
            "alone"
        )


def _unpacked_size(file: Path) -> int:
    """Size of a file; beyond the limit, no more than that is unpacked."""
    import zstandard  # noqa: PLC0415  # an extra

    size = 0
    with file.open("rb") as packed, suppress(zstandard.ZstdError):
        unpacking = zstandard.ZstdDecompressor().stream_reader(
            packed, read_across_frames=True
        )
        while size <= MAX_BYTES and (part := unpacking.read(READ_SIZE)):
            size += len(part)
    return max(size, file.stat().st_size)


def _topic_of(path: str | os.PathLike, topics: Any, wanted: str | None) -> str:
    names = sorted(topics)
    if wanted is None and len(names) == 1:
        return names[0]
    if wanted is None or wanted not in names:
        given = "no topic" if wanted is None else f"'{wanted}'"
        raise LogError(
            f"{path}: the map names {given}; set rows.topic to one of "
            f"{list_names(names)}, or to one for each joined file"
        )
    return wanted


def _rows_of(
    bag: Any,
    topic: str,
    is_first: bool,
) -> Iterator[dict[str, float]]:
    """The numbers of every message of a topic, by their names."""
    from rosbags.typesys import (  # noqa: PLC0415  # an extra
        Stores,
        get_typestore,
    )

    store = Stores.ROS1_NOETIC if is_first else Stores.LATEST
    types = get_typestore(store)
    decode = types.deserialize_ros1 if is_first else types.deserialize_cdr
    connections = [each for each in bag.connections if each.topic == topic]
    unknown = {each.msgtype for each in connections} - set(types.types)
    if unknown:
        raise LogError(
            f"{bag.path}: '{topic}' has messages of {list_names(sorted(unknown))}, which "
            "are no standard ones; export the topic as CSV (`ros2 topic echo --csv`)"
        )
    for connection, moment, raw in bag.messages(connections):
        message = decode(raw, connection.msgtype)
        row = dict(_leaves(message))
        yield row | {TIME: moment * NANOSECOND}


def _leaves(message: Any) -> Iterator[tuple[str, float]]:
    """Name and value of each number of a message."""
    waiting = [("", message)]
    while waiting:
        name, value = waiting.pop()
        begin = f"{name}." if name else ""
        if hasattr(value, "nanosec"):
            yield name, value.sec + NANOSECOND * value.nanosec
        elif hasattr(value, "__dataclass_fields__"):
            fields = [key for key in value.__dataclass_fields__ if key[0] != "_"]
            waiting += [(begin + key, getattr(value, key)) for key in fields]
        elif isinstance(value, np.ndarray | list):
            count = len(value)
            if count > MAX_COLUMNS:
                raise LogError(
                    f"'{name}' has {count} numbers in a message; at most {MAX_COLUMNS} are read. "
                    "Choose a topic of numbers, not of pictures or clouds"
                )
            waiting += [(f"{begin}{index}", part) for index, part in enumerate(value)]
        elif isinstance(value, int | float | np.number):
            yield name, float(value)


def table_of_rows(
    path: str | os.PathLike, rows: Iterator[dict[str, float]], request: ColumnRequest
) -> Table:
    """Table of the numbers of messages, one row each.

    Raises:
        LogError: there is no message, or none has a requested column.
    """
    first = next(rows, None)
    if first is None:
        raise LogError(f"{path}: the topic has no messages; record it anew")
    builder = TableBuilder(path, request, first)
    wanted = [*builder.numbers, *builder.labels]
    for number, row in enumerate([first, *rows]):
        cells = [row.get(name) for name in wanted]
        builder.add(f"message {number}", cells)
    table = builder.build()
    stamps = {TIME, STAMP} & set(table.numbers)
    return replace(table, stamps=frozenset(stamps))
