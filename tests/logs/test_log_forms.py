"""One log in each form is the same take, so that all fits of it are the same."""

import gzip
import json
import re
import sys
from datetime import UTC, datetime

import numpy as np
import openpyxl  # type: ignore[import-untyped]
import pyarrow  # type: ignore[import-untyped]
import pytest
from pyarrow import parquet  # type: ignore[import-untyped]
from simulated_logs import record, write_log  # type: ignore[import-not-found]

from s2c2a.logs import map_from_toml
from s2c2a.logs.errors import LogError
from s2c2a.logs.pipeline import _read_takes
from s2c2a.logs.reading import read_here
from s2c2a.logs.tables import ColumnRequest

EPOCH = 1_700_000_000  # s
MOTIVE = (
    "Format Version,1.23,Take Name,Take 1,Rotation Type,Quaternion,"
    "Length Units,Meters,Coordinate Space,Global\n\n"
)


@pytest.fixture(scope="module")
def log(twin, tmp_path_factory):
    """A log of a simulated arm, its map, and its columns."""
    folder = tmp_path_factory.mktemp("forms")
    recording = record(folder / "twin.episodes", twin, 30)
    simulated = write_log(folder, recording, tip_only=True, signs_stated=True)
    table = np.genfromtxt(simulated.path, delimiter=",", names=True)
    columns = {name: table[name] for name in table.dtype.names}
    return simulated, columns


def take_of(path, text):
    (take,) = _read_takes([path], map_from_toml(text))
    return take


def check_same(log, path, text=None):
    """The file is the take of the plain log."""
    simulated, _ = log
    expected = take_of(simulated.path, simulated.map)
    take = take_of(path, text or simulated.map)
    np.testing.assert_allclose(
        take.time - take.time[0], expected.time - expected.time[0], atol=1e-6
    )
    for name in ("commanded", "measured", "positions"):
        np.testing.assert_array_equal(getattr(take, name), getattr(expected, name))


def delimited(columns, delimiter, header=True, comma=False):
    rows = [delimiter.join(columns)] if header else []
    for values in zip(*columns.values(), strict=True):
        row = delimiter.join(repr(float(value)) for value in values)
        rows.append(row.replace(".", ",") if comma else row)
    return "\n".join(rows) + "\n"


def numbered(text, columns):
    """Map of a log without header."""
    for index, name in enumerate(columns, 1):
        text = text.replace(f'"{name}"', f'"{index}"')
    return text


TEXTS = {
    "comma": lambda c: delimited(c, ","),
    "semicolon": lambda c: delimited(c, ";", comma=True),
    "tab": lambda c: delimited(c, "\t"),
    "bar": lambda c: delimited(c, "|", comma=True),
    "blanks": lambda c: "  " + delimited(c, "   ").replace("\n", "  \n  "),
    "blanks with decimal commas": lambda c: delimited(c, "  ", comma=True),
    "byte order mark": lambda c: "\ufeff" + delimited(c, ","),
    "UTF-16": lambda c: delimited(c, ";").encode("utf-16"),
    "gzip": lambda c: gzip.compress(delimited(c, ",").encode()),
    "comments": lambda c: "# by hand\n// of mine\n" + delimited(c, ",") + "# end\n",
    "savetxt": lambda c: "# made by NumPy\n# " + delimited(c, " "),
}


@pytest.mark.parametrize("form", TEXTS)
def test_text_of_every_kind_is_the_same_take(log, written, form):
    check_same(log, written(TEXTS[form](log[1])))


@pytest.mark.parametrize("comma", [False, True])
@pytest.mark.parametrize("delimiter", [",", ";", "\t", "|", "  "])
def test_columns_without_header_are_numbered(log, written, delimiter, comma):
    simulated, columns = log
    is_comma = comma and delimiter != ","
    text = delimited(columns, delimiter, header=False, comma=is_comma)
    check_same(log, written(text), numbered(simulated.map, columns))


def timed(columns, times):
    """Lines of a log with other times."""
    head, *rows = delimited(columns, ",").splitlines()
    others = [row.partition(",")[2] for row in rows]
    return [head, *(f"{t},{rest}" for t, rest in zip(times, others, strict=True))]


@pytest.mark.parametrize("zone", ["", "+00:00", "Z"])
@pytest.mark.parametrize("has_header", [False, True])
def test_time_stamps_are_read(log, written, zone, has_header):
    simulated, columns = log
    stamps = [
        datetime.fromtimestamp(EPOCH + t, UTC).replace(tzinfo=None).isoformat() + zone
        for t in columns["t"]
    ]
    lines = timed(columns, stamps)
    text = simulated.map if has_header else numbered(simulated.map, columns)
    check_same(log, written("\n".join(lines[not has_header :])), text)


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
@pytest.mark.parametrize("is_stated", [False, True])
def test_times_since_1970_are_read_in_any_unit(log, written, unit, is_stated):
    simulated, columns = log
    factor = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}[unit]
    times = [f"{(EPOCH * 10 + round(10 * t)) * factor / 10:.1f}" for t in columns["t"]]
    stated = f'time = "t"\nunit = "{unit}"'
    text = simulated.map.replace('time = "t"', stated) if is_stated else simulated.map
    check_same(log, written("\n".join(timed(columns, times))), text)


def test_a_column_of_numbers_and_time_stamps_is_refused(log, written):
    simulated, columns = log
    times = ["2026-01-01T00:00:00", *columns["t"][1:]]
    path = written("\n".join(timed(columns, times)))
    with pytest.raises(LogError, match="'t' has both numbers and time stamps"):
        take_of(path, simulated.map)


def json_rows(columns):
    for values in zip(*columns.values(), strict=True):
        row = dict(zip(columns, map(float, values), strict=True))
        yield {
            "t": row.pop("t"),
            "pose": {"position": {axis: row.pop(f"{axis}2") for axis in "xyz"}},
            "c": [row[f"c{index}"] for index in range(9)],
            "m": [row[f"m{index}"] for index in range(9)],
        }


def nested(text):
    """Map of a log with nested names."""
    text = re.sub(r'"([cm])(\d)"', r'"\1.\2"', text)
    return with_tip(text, "pose.position.{0}")


def with_tip(text, names):
    """Map whose tip has other columns."""
    for axis in "xyz":
        text = text.replace(f'"{axis}2"', f'"{names.format(axis, axis.upper())}"')
    return text


@pytest.mark.parametrize("ending", ["jsonl", "ndjson", "json", "jsonl.gz"])
def test_json_lines_are_the_same_take(log, written, ending):
    simulated, columns = log
    content = "\n".join(map(json.dumps, json_rows(columns))).encode()
    packed = gzip.compress(content) if ending.endswith("gz") else content
    check_same(log, written(packed, f"log.{ending}"), nested(simulated.map))


def test_broken_json_is_refused_with_its_line_or_a_gap(log, written):
    simulated, columns = log
    lines = list(map(json.dumps, json_rows(columns)))
    lines[4] = lines[4][:-9]
    path = written("\n".join(lines), "log.jsonl")
    text = nested(simulated.map)
    with pytest.raises(LogError, match="line 5, it is not one complete JSON object"):
        take_of(path, text)
    allowed = text.replace("[rows]", '[rows]\nbroken_rows = "gap"')
    assert take_of(path, allowed).broken_rows == 1


def motors_of(columns, first):
    """Text of the drives alone, by frame."""
    frames = {"Frame": first + np.arange(len(columns["t"]), dtype=float)}
    drives = {name: columns[name] for name in columns if name[0] in "cm"}
    return delimited(frames | drives, ";")


def test_an_export_of_motive_is_the_same_take(log, written):
    simulated, columns = log
    kinds = ["Rotation"] * 4 + ["Position"] * 3 + ["Mean Marker Error"]
    tip = [columns[f"{axis}2"] for axis in "xyz"]
    text = MOTIVE
    text += f",Type,{','.join(['Rigid Body'] * 8 + ['Marker'] * 3)}\n"
    text += f",Name,{','.join(['end'] * 8 + ['tip'] * 3)}\n,ID,{','.join(['A'] * 11)}\n"
    text += f",,{','.join([*kinds, *['Position'] * 3])}\n"
    text += "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,,X,Y,Z\n"
    for frame, position in enumerate(zip(*tip, strict=True)):
        place = ",".join(repr(float(value)) for value in position)
        time = float(columns["t"][frame])
        text += f"{frame},{time!r},0,0,0,1,{place},0.0001,{place}\n"
    motors = "by hand\n" + motors_of(columns, 0)
    paths = [written(text, "motive.csv"), written(motors, "motors.csv")]
    changed = simulated.map.replace('time = "t"', 'time = "Time (Seconds)"')
    changed = changed.replace(
        "[arm]", 'skip_lines = [0, 1]\n[join]\nkey = "Frame"\n[arm]'
    )
    expected = take_of(simulated.path, simulated.map)
    for name in ("end.Position", "tip"):
        named = with_tip(changed, name + ".{1}")
        (take,) = _read_takes(paths, map_from_toml(named))
        np.testing.assert_array_equal(take.positions, expected.positions)
        np.testing.assert_array_equal(take.measured, expected.measured)
        np.testing.assert_array_equal(take.time, expected.time)
    with pytest.raises(LogError, match='in m, and the map mm; write unit = "m"'):
        _read_takes(paths, map_from_toml(named.replace('"m"\n', '"mm"\n')))


def qualisys(columns, has_times):
    """Export of two markers, the second of which is the tip, at 10 Hz."""
    text = "NO_OF_FRAMES\t60\nNO_OF_MARKERS\t2\nFREQUENCY\t10\nDATA_INCLUDED\t3D\n"
    text += "MARKER_NAMES\tbase\ttip\n"
    if has_times:
        text += "Frame\tTime\tbase X\tbase Y\tbase Z\ttip X\ttip Y\ttip Z\n"
    for frame in range(len(columns["t"])):
        begin = [frame + 1, 0.1 * frame] if has_times else []
        tip = [1e3 * float(columns[f"{axis}2"][frame]) for axis in "xyz"]
        text += "\t".join(map(repr, [*begin, 0.0, 0.0, 0.0, *tip])) + "\n"
    return text


@pytest.mark.parametrize("has_times", [False, True])
def test_an_export_of_qualisys_is_the_same_take(log, written, has_times):
    simulated, columns = log
    paths = [
        written(qualisys(columns, has_times), "qtm.tsv"),
        written(motors_of(columns, 1), "motors.csv"),
    ]
    changed = simulated.map.replace('time = "t"', 'time = "Time"')
    changed = changed.replace("[arm]", '[join]\nkey = "Frame"\n[arm]')
    changed = with_tip(changed, "tip.{1}")
    with pytest.raises(LogError, match="in mm, and the map m"):
        _read_takes(paths, map_from_toml(changed))
    changed = changed.replace('unit = "m"', 'unit = "mm"')
    (take,) = _read_takes(paths, map_from_toml(changed))
    expected = take_of(simulated.path, simulated.map)
    np.testing.assert_allclose(take.positions, expected.positions, rtol=1e-12)
    np.testing.assert_allclose(take.time, 0.1 * np.arange(len(take)), atol=1e-9)
    lost = changed.replace('"tip.', '"base.')
    (take,) = _read_takes(paths, map_from_toml(lost))
    assert np.isnan(take.positions).all()


def test_bodies_of_qualisys_have_rotation_matrices(written):
    names = "\t".join(["X", "Y", "Z", "Roll", "Pitch", "Yaw", "Residual"])
    names += "".join(f"\tRot[{index}]" for index in range(9))
    text = "NO_OF_FRAMES\t60\nFREQUENCY\t10\nDATA_INCLUDED\t6D\nBODY_NAMES\ta\tb\n"
    text += f"Frame\tTime\t\t{names}\t\t{names}\n"
    # a quarter turn about x, column by column
    row = "1\t2\t3\t90\t0\t0\t0.1\t1\t0\t0\t0\t0\t1\t0\t-1\t0"
    for frame in range(3):
        text += f"{frame + 1}\t{frame / 10}\t\t{row}\t\t{row}\n"
    order = [0, 3, 6, 1, 4, 7, 2, 5, 8]
    matrix = [f"b.Rot[{index}]" for index in order]
    take = take_of(
        written(text, "qtm.tsv"),
        '[rows]\nkind = "timed"\ntime = "Time"\n[arm]\nname = "a"\nmodules = 1\n'
        'control_rate = 10\n[[drives]]\nmeasured = "a.X"\nunit = "cm"\nscale = 2\n'
        '[[ends]]\nposition = ["b.X", "b.Y", "b.Z"]\nunit = "mm"\n'
        f"matrix = {matrix}\n",
    )
    np.testing.assert_allclose(take.axes[:, 0], [[0, -1, 0]] * 3, atol=1e-12)
    np.testing.assert_allclose(take.measured[:, 0], 0.02)


@pytest.mark.parametrize(
    ("name", "way_out"),
    [
        ("log.h5", "HDF5: save the arrays as NPZ"),
        ("log.npy", "numpy.savez"),
        ("log.pkl", "it could run code"),
        ("log.tak", "export as CSV from Motive"),
        ("log.ods", "export as CSV"),
    ],
)
def test_what_is_not_read_is_named_with_the_way_out(log, written, name, way_out):
    path = written(b"\x00\x01", name)
    with pytest.raises(LogError, match=way_out):
        take_of(path, log[0].map)


def test_lines_to_skip_are_one_for_each_joined_file(log):
    text = log[0].map.replace("[arm]", "skip_lines = [0, 1]\n[arm]")
    with pytest.raises(LogError, match="skip_lines has 2 values for 1 joined"):
        map_from_toml(text)


def write_sheet(path, columns, times):
    book = openpyxl.Workbook()
    book.active.append(list(columns))
    for time, values in zip(times, zip(*columns.values(), strict=True), strict=True):
        book.active.append([time, *map(float, values[1:])])
    book.save(path)


@pytest.mark.parametrize("has_stamps", [False, True])
def test_sheets_are_the_same_take(log, tmp_path, has_stamps):
    simulated, columns = log
    times = columns["t"].tolist()
    if has_stamps:
        stamps = [datetime.fromtimestamp(EPOCH + t, UTC) for t in times]
        times = [stamp.replace(tzinfo=None) for stamp in stamps]
    path = tmp_path / "log.xlsx"
    write_sheet(path, columns, times)
    expected = take_of(simulated.path, simulated.map)
    take = take_of(path, simulated.map)
    np.testing.assert_array_equal(take.positions, expected.positions)
    # Excel stores a day in double precision
    times = take.time - take.time[0]
    np.testing.assert_allclose(times, expected.time, atol=2e-3)


@pytest.mark.parametrize("has_stamps", [False, True])
def test_parquet_is_the_same_take(log, tmp_path, has_stamps):
    simulated, columns = log
    rows = list(json_rows(columns))
    if has_stamps:
        for row in rows:
            row["t"] = datetime.fromtimestamp(EPOCH + row["t"], UTC)
    path = tmp_path / "log.parquet"
    parquet.write_table(pyarrow.Table.from_pylist(rows), path)
    check_same(log, path, nested(simulated.map))


def test_parquet_with_dots_in_its_names_is_the_same_take(log, tmp_path):
    simulated, columns = log
    named = {f"a.{name}": values for name, values in columns.items()}
    text = simulated.map
    for name in columns:
        text = text.replace(f'"{name}"', f'"a.{name}"')
    path = tmp_path / "log.parquet"
    parquet.write_table(pyarrow.table(named), path)
    check_same(log, path, text)


@pytest.mark.parametrize("name", ["log.xlsx", "log.parquet"])
def test_without_the_extra_the_way_out_names_it(written, monkeypatch, name):
    for module in ("openpyxl", "pyarrow.parquet"):
        monkeypatch.setitem(sys.modules, module, None)
    form = {"log.xlsx": "XLSX", "log.parquet": "Parquet"}[name]
    told = f'{form}: export as CSV, or install the extra: pip install "s2c2a[tables]"'
    with pytest.raises(LogError, match=re.escape(told)):
        read_here(written(b"PK", name), ColumnRequest(["a"]))


@pytest.mark.parametrize("ending", ["xlsx", "parquet"])
def test_damaged_tables_are_errors(log, tmp_path, ending):
    simulated, columns = log
    path = tmp_path / f"log.{ending}"
    if ending == "xlsx":
        write_sheet(path, columns, columns["t"].tolist())
    else:
        parquet.write_table(pyarrow.table(columns), path)
    content = path.read_bytes()
    for cut in (0, 4, len(content) // 2, len(content) - 3):
        path.write_bytes(content[:cut])
        with pytest.raises(LogError):
            take_of(path, simulated.map)


NEXUS = """
        [rows]
        kind = "steps"
        skip_lines = [0, 5]
        [join]
        files = 2
        by = "row"
        [arm]
        name = "a"
        modules = 1
        control_rate = 10
        [[drives]]
        commanded = "1:2"
        unit = "mm"
        [[ends]]
        position = ["2:3", "2:4", "2:5"]
        unit = "mm"
        """


@pytest.fixture
def nexus(written):
    """Values of motors, and an ASCII export of Vicon Nexus; neither has names."""
    names = "Trajectories\n100\n,,Arm:tip,,\nFrame,Sub Frame,X,Y,Z\n,,mm,mm,mm\n"
    ends = f"{names}100,0,10,20,300\n101,0,11,21,299\n"
    motors = written("1.0,2.0\n1.01,4.0\n", "motors.csv")
    return motors, written(ends, "nexus.csv")


def test_files_without_names_stand_side_by_side(nexus):
    (take,) = _read_takes(nexus, map_from_toml(NEXUS))
    np.testing.assert_allclose(take.commanded[:, 0], [0.002, 0.004])
    np.testing.assert_allclose(take.positions[0, 0], [0.01, 0.02, 0.3])
    same = NEXUS.replace("1:2", "2").replace("2:3", "1")
    with pytest.raises(LogError, match=r"several of .* write 1:NAME"):
        _read_takes(nexus, map_from_toml(same))


def test_numbers_of_frames_are_times(nexus):
    rate = 'by = "time"\ntimes = ["1:1", "2:1"]\nunits = ["s", 0.01]\noffset = [0]'
    text = NEXUS.replace('by = "row"', rate)
    text = text.replace('kind = "steps"', 'kind = "timed"\ntime = "1:1"')
    (take,) = _read_takes(nexus, map_from_toml(text))
    np.testing.assert_allclose(take.time, [1.0, 1.01])
    np.testing.assert_allclose(take.positions[1, 0], [0.011, 0.021, 0.299])


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (
            "[0, 5]",
            "[0, 4]",
            r"it has mm, mm, mm, below the 4 lines .* correct that number",
        ),
        (
            "[0, 5]",
            "[0, 6]",
            r"motors\.csv has 2 rows, .*nexus\.csv has 1 row; .*skip_lines",
        ),
        ("2:5", "3:3", r"names: 3:3; .*; N:NAME is column NAME of the Nth"),
    ],
)
def test_a_wrong_map_of_files_without_names_says_what_is_wrong(nexus, old, new, told):
    with pytest.raises(LogError, match=told):
        _read_takes(nexus, map_from_toml(NEXUS.replace(old, new)))


def test_a_column_whose_name_looks_like_that_of_a_file_is_written_with_the_file(nexus):
    nexus[0].write_text("t,1:x\n1.0,2.0\n3.0,4.0\n")
    named = NEXUS.replace("1:2", "1:1:x")
    (take,) = _read_takes(nexus, map_from_toml(named))
    np.testing.assert_allclose(take.commanded[:, 0], [0.002, 0.004])
    with pytest.raises(LogError, match="a column called 1:x itself is 1:1:x"):
        _read_takes(nexus, map_from_toml(NEXUS.replace("1:2", "1:x")))
