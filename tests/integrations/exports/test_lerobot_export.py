"""LeRobotDatasets: the layout that LeRobot reads, and import of what was exported."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from s2c2a.arm import arm_from_toml
from s2c2a.cli.export_table import table_of
from s2c2a.errors import S2C2AError
from s2c2a.integrations.exports.lerobot import write_lerobot
from s2c2a.logs import import_logs, load_map
from s2c2a.logs.errors import LogError
from s2c2a.logs.reading import read_table
from s2c2a.logs.tables import ColumnRequest

parquet = pytest.importorskip("pyarrow.parquet")
DATA = Path("data", "chunk-000", "file-000.parquet")
INDICES = {"timestamp", "frame_index", "episode_index", "index", "task_index"}


@pytest.fixture(scope="module")
def dataset(recording):
    assert write_lerobot(recording, recording.with_suffix("")) == "2 episodes"
    return recording.with_suffix("")


@pytest.fixture
def info(dataset):
    return json.loads((dataset / "meta" / "info.json").read_text())


@pytest.fixture
def table(dataset):
    return parquet.read_table(dataset / DATA)


def test_every_feature_is_a_column_of_its_type(table, info):
    assert set(info["features"]) == set(table.column_names)
    assert set(table.column_names) > INDICES
    for name, feature in info["features"].items():
        (width,) = feature["shape"]
        kind = table.schema.field(name).type
        inner = kind if width == 1 else kind.value_type
        assert str(inner).replace("double", "float64") in (
            feature["dtype"],
            feature["dtype"].removesuffix("32"),
        )
        if width > 1:
            assert kind.list_size == width == len(feature["names"])
    assert info["codebase_version"] == "v3.0"
    assert info["fps"] == 10


def test_frames_hold_what_was_recorded(table, episodes):
    actions = np.array(table["action"].to_pylist())
    both = np.concatenate([episode["actions"] for episode in episodes])
    np.testing.assert_allclose(actions, both.reshape(len(both), -1), rtol=1e-7)
    length = len(episodes[0])
    frames = table["frame_index"].to_numpy()
    assert frames[length - 1 : length + 1].tolist() == [length - 1, 0]
    np.testing.assert_allclose(table["timestamp"].to_numpy(), frames / 10, rtol=1e-6)
    np.testing.assert_array_equal(table["index"].to_numpy(), np.arange(len(both)))


def test_targets_are_held_and_missing_readings_stay_missing(
    dataset, table, info, episodes
):
    targets = np.array(table["observation.environment_state"].to_pylist())
    names = info["features"]["observation.environment_state"]["names"]
    assert names == [f"desired_positions.3.{axis}" for axis in "xyz"]
    length = len(episodes[0])
    assert np.isnan(targets[:length]).all()
    np.testing.assert_allclose(
        targets[length:], [[0.1, 0.0, 0.5]] * (length), rtol=1e-6
    )
    states = np.array(table["observation.state"].to_pylist())
    missing = np.argwhere(np.isnan(states))
    names = info["features"]["observation.state"]["names"]
    assert {names[place] for _, place in missing} == {
        f"states.2.{axis}" for axis in ("x", "y", "z", "axis_x", "axis_y", "axis_z")
    }
    assert set(missing[:, 0]) == {length + 3}
    stats = json.loads((dataset / "meta" / "stats.json").read_text())
    assert np.isfinite(stats["observation.state"]["mean"]).all()


def test_episodes_and_tasks_are_listed(dataset, table, episodes):
    meta = parquet.read_table(dataset / "meta" / "episodes" / DATA.relative_to("data"))
    assert meta["dataset_from_index"].to_pylist() == [0, len(episodes[0])]
    assert meta["tasks"].to_pylist() == [["two"], ["circle"]]
    count = table["action"].type.list_size
    assert all(len(each) == count for each in meta["stats/action/std"].to_pylist())
    tasks = parquet.read_table(dataset / "meta" / "tasks.parquet")
    pandas = json.loads(tasks.schema.metadata[b"pandas"])
    assert tasks[pandas["index_columns"][0]].to_pylist() == ["two", "circle"]
    source = json.loads((dataset / "meta" / "s2c2a.json").read_text())
    assert arm_from_toml(source["arm"], "arm") == episodes[0].arm


@pytest.mark.slow
def test_an_exported_dataset_is_imported_with_the_same_rows(dataset, episodes):
    log_map = load_map(f"{dataset}.map.toml")
    request = ColumnRequest(log_map.number_columns, log_map.label_columns)
    table = read_table(dataset, request)
    known = table_of(episodes)
    np.testing.assert_array_equal(table.numbers["log_time"], known["log_time"])
    for drive in log_map.drives:
        name = drive.commanded.replace("action.cable", "actions")
        np.testing.assert_allclose(
            table.numbers[drive.commanded], known[name], rtol=1e-7
        )
    tip = log_map.ends[2].position[0]
    np.testing.assert_allclose(
        table.numbers[tip], known["sensor.states.3.x"], rtol=1e-6, atol=1e-9
    )
    imported = import_logs([dataset], log_map)
    assert len(imported.episodes) == 2
    lengths = [module.length for module in imported.arm.modules]
    true = [module.length for module in episodes[0].arm.modules]
    np.testing.assert_allclose(lengths, true, rtol=0.01)


def test_a_dataset_of_others_has_a_time_that_goes_on(dataset, tmp_path):
    other = tmp_path / "other"
    shutil.copytree(dataset, other)
    table = parquet.read_table(other / DATA).drop_columns(["log_time"])
    parquet.write_table(table, other / DATA)
    read = read_table(other, ColumnRequest(["log_time", "action.cable.1.1"]))
    np.testing.assert_allclose(read.numbers["log_time"], np.arange(len(read)) / 10)


def test_another_version_of_datasets_is_refused(dataset, tmp_path):
    info = dataset / "meta" / "info.json"
    (tmp_path / "meta").mkdir()
    text = info.read_text().replace('"v3.0"', '"v2.1"')
    (tmp_path / "meta" / "info.json").write_text(text)
    with pytest.raises(LogError, match="convert it with LeRobot's"):
        read_table(tmp_path, ColumnRequest(["action.cable.1.1"]))


def test_an_existing_folder_is_not_replaced(recording, tmp_path):
    (tmp_path / "mine").mkdir()
    with pytest.raises(S2C2AError, match="a folder is not replaced"):
        write_lerobot(recording, tmp_path / "mine")
