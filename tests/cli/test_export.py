import csv
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat

from s2c2a.arm import arm_from_toml
from s2c2a.cli.export import export
from s2c2a.episodes import load_episodes, save_episodes
from s2c2a.errors import S2C2AError
from s2c2a.logs import import_logs, load_map

RECORDING = Path(__file__).parents[1] / "fixtures" / "twin.episodes"


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("export") / "two.episodes"
    episodes, options = load_episodes(RECORDING)
    save_episodes(episodes[:2], path, options)
    return path


def exported(recording, out):
    """Episode 2 and the text of a written file."""
    export(recording, out)
    if out.suffix == ".npz":
        content = np.load(out)
        names = [name for name in content if name.startswith("episode2.")]
        second = {name.removeprefix("episode2."): content[name] for name in names}
    else:
        content = loadmat(out, simplify_cells=True)
        second = content["episode2"]
    return second, str(content["arm"]), str(content["options"])


@pytest.mark.parametrize("ending", ["npz", "mat"])
def test_exported_episodes_read_back_equal(recording, tmp_path, ending):
    second, arm, options = exported(recording, tmp_path / f"two.{ending}")
    episodes, known_options = load_episodes(recording)
    assert arm_from_toml(arm, "arm") == episodes[1].arm
    assert json.loads(options) == known_options
    assert json.loads(str(second.pop("options"))) == dict(episodes[1].options)
    assert len(second) == len(episodes[1].columns)
    for name, values in episodes[1].columns.items():
        array = second[name.replace(".", "_")]
        np.testing.assert_array_equal(array, values)


def test_vectors_are_columns_in_matlab(recording, tmp_path):
    export(recording, tmp_path / "two.mat")
    first = loadmat(tmp_path / "two.mat")["episode1"]
    steps = len(load_episodes(recording)[0][0])
    vectors = [first[name][0, 0].shape for name in ("time", "stage")]
    assert vectors == [(steps, 1)] * 2


def check_table(columns, episodes):
    """Every number of the episodes is in the table, in full precision."""
    rows = np.cumsum([len(episode) for episode in episodes])
    for number, episode in enumerate(episodes):
        part = slice(rows[number] - len(episode), rows[number])
        assert (columns["episode"][part] == number + 1).all()
        np.testing.assert_array_equal(columns["time"][part], episode["time"])
        for module, cable in np.ndindex(episode["actions"].shape[1:]):
            np.testing.assert_array_equal(
                columns[f"actions.{module + 1}.{cable + 1}"][part],
                episode["actions"][:, module, cable],
            )
        tip = [columns[f"sensor.states.3.{axis}"][part] for axis in "xyz"]
        np.testing.assert_array_equal(tip, episode.sensor("states")[:, 2, :3].T)
    assert (np.diff(columns["log_time"]) > 0).all()
    numbers = sum(values[0].size for values in episodes[0].columns.values())
    assert len(columns) == numbers + 2


def test_an_exported_csv_reads_back_equal(recording, tmp_path):
    out = tmp_path / "two.csv"
    export(recording, out)
    with open(out, encoding="utf-8") as file:
        comment = file.readline()
        header, *rows = csv.reader(file)
    assert "actions [m]" in comment
    values = [[float(cell or "nan") for cell in row] for row in rows]
    columns = dict(zip(header, np.array(values).T, strict=True))
    check_table(columns, load_episodes(recording)[0])
    genfromtxt = np.genfromtxt(out, delimiter=",", skip_header=2)
    np.testing.assert_array_equal(genfromtxt, values)


def test_missing_values_are_empty_cells(tmp_path):
    (episode, *_), options = load_episodes(RECORDING)
    states = np.array(episode.sensor("states"))
    states[3, 1] = np.nan
    stds = np.zeros(states.shape[:2])
    more = {"sensor.states": states, "predictive_std": stds}
    lost = replace(episode, columns={**episode.columns, **more})
    columns = {name: episode[name] for name in ("time", "actions")}
    short = replace(episode, columns=columns)
    path = tmp_path / "lost.episodes"
    save_episodes([lost, short], path, options)
    export(path, tmp_path / "lost.csv")
    text = (tmp_path / "lost.csv").read_text()
    rows = list(csv.DictReader(text.splitlines()[1:]))
    assert rows[3]["sensor.states.2.x"] == ""
    # of modules, also where these are three
    assert rows[3][f"predictive_std.{stds.shape[1]}"] == "0.0"
    assert float(rows[3]["sensor.states.1.x"]) == states[3, 0, 0]
    assert rows[len(episode)]["sensor.states.1.x"] == ""
    assert "nan" not in text


def test_an_exported_parquet_file_reads_back_equal(recording, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    out = tmp_path / "two.parquet"
    export(recording, out)
    table = parquet.read_table(out)
    columns = {name: table[name].to_numpy() for name in table.column_names}
    episodes, options = load_episodes(recording)
    check_table(columns, episodes)
    metadata = table.schema.metadata
    assert arm_from_toml(metadata[b"arm"].decode(), "arm") == episodes[0].arm
    assert json.loads(metadata[b"options"]) == options
    assert json.loads(metadata[b"units"])["actions"] == "m"


def test_without_pyarrow_the_extra_is_named(recording, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(S2C2AError, match=r"s2c2a\[tables\]"):
        export(recording, tmp_path / "two.parquet")
    assert not (tmp_path / "two.parquet").exists()


@pytest.mark.slow
def test_an_exported_csv_is_imported_again_with_its_map(recording, tmp_path):
    out = tmp_path / "two.csv"
    export(recording, out)
    imported = import_logs([out], load_map(f"{out}.map.toml"))
    episodes, _ = load_episodes(recording)
    arm = episodes[0].arm
    assert len(imported.episodes) == len(episodes)
    assert imported.arm.coupled_cables == arm.coupled_cables
    std = imported.fit.std
    assert std is not None
    # an import sorts cables by their angles, and drives are written by cable
    drives = imported.layout.drive
    for module, (found, true) in enumerate(
        zip(imported.arm.modules, arm.modules, strict=True)
    ):
        assert found.length == pytest.approx(true.length, rel=0.01)
        assert found.cable_radius == pytest.approx(true.cable_radius, abs=1e-5)
        assert found.bend_limit_deg == true.bend_limit_deg
        cables = drives[module] - module * arm.cable_count
        errors = np.subtract(
            found.cable_angles_deg, np.array(true.cable_angles_deg)[cables]
        )
        deviations = np.rad2deg(std.angles[drives[module]])
        assert (np.abs((errors + 180) % 360 - 180) < 4 * deviations).all()
    for found, true in zip(imported.episodes, episodes, strict=True):
        actions = true["actions"].reshape(len(true), -1)[:, drives]
        np.testing.assert_allclose(found["actions"], actions[: len(found)], atol=2e-4)


@pytest.mark.parametrize(
    ("out", "message"),
    [
        (None, "no --out was given; add --to"),
        ("two", "has no ending; add --to"),
        ("two.xls", "choose one of csv, parquet, npz, mat"),
    ],
)
def test_a_form_that_is_not_known_is_asked_for(recording, tmp_path, out, message):
    with pytest.raises(S2C2AError, match=message):
        export(recording, out and tmp_path / out)


def test_a_form_by_name_is_written_to_the_current_folder(
    recording, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    export(recording, to="npz")
    assert "episode1.time" in np.load("two.npz")


def test_a_form_of_a_users_file(recording, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    code = "def write(file, out):\n    out.write_text(file.name)\n    return 'a name'\n"
    (tmp_path / "own_form.py").write_text(code)
    export(recording, tmp_path / "name.txt", to="own_form.py:write")
    assert (tmp_path / "name.txt").read_text() == "two.episodes"
    assert "a name: " in capsys.readouterr().out


def test_the_files_of_a_form_that_writes_several_are_named(
    recording, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    code = (
        "def write(file, out):\n"
        "    out.with_suffix('.step.onnx').touch()\n"
        "    return 'one model'\n"
    )
    (tmp_path / "own_models.py").write_text(code)
    export(recording, tmp_path / "two.onnx", to="own_models.py:write")
    assert capsys.readouterr().out.endswith("two.*.onnx\n")


def test_a_file_is_not_replaced_by_its_own_export(recording):
    before = recording.read_bytes()
    with pytest.raises(S2C2AError, match="is the file itself; choose another name"):
        export(recording, recording, to="csv")
    assert recording.read_bytes() == before


def test_a_folder_is_answered_with_a_file_in_it(recording, tmp_path):
    with pytest.raises(S2C2AError, match=rf"is a folder; give .*{recording.name}"):
        export(recording.parent, tmp_path / "mine.csv")
