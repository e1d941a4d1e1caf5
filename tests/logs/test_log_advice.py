"""Logs that miss what an import needs: what to do is said, and is true."""

import numpy as np
import pytest

from s2c2a.logs import import_logs, map_from_toml
from s2c2a.logs.errors import LogError
from s2c2a.logs.log_map import LogMap
from s2c2a.logs.pipeline import _read_takes

MAP = """
[rows]
kind = "timed"
time = "t"
[arm]
name = "arm"
modules = 1
control_rate = 10
[[drives]]
commanded = "a"
unit = "mm"
[[ends]]
position = ["x", "y", "z"]
unit = "mm"
"""


def rows(times) -> str:
    return "".join(f"{time},0,1,2,3\n" for time in times)


def read(path, text: str, log_map: LogMap | None = None, encoding="utf-8"):
    path.write_text(text, encoding=encoding)
    return _read_takes([path], log_map or map_from_toml(MAP))[0]


def test_times_of_day_pass_midnight(tmp_path):
    times = ["23:59:59.900", "00:00:00.000", "00:00:00.100"]
    take = read(tmp_path / "log.csv", "t,a,x,y,z\n" + rows(times))
    np.testing.assert_allclose(np.diff(take.time), 0.1)


@pytest.mark.parametrize("time", ["52:45.5", "31/01/2026 11:33:04"])
def test_another_form_of_times_names_those_that_are_read(tmp_path, time):
    with pytest.raises(LogError, match=r"is no time; write .*11:33:04.*ISO 8601"):
        read(tmp_path / "log.csv", "t,a,x,y,z\n" + rows([time, time]))


def test_text_of_western_windows_programs_is_read(tmp_path):
    log_map = map_from_toml(MAP.replace('"a"', '"a [°]"'))
    text = "t,a [°],x,y,z\n" + rows(range(3))
    take = read(tmp_path / "log.csv", text, log_map, "cp1252")
    assert len(take) == 3


@pytest.mark.parametrize(
    ("head", "told"),
    [
        ("logger 3\n\nt,a,x,y,z\n", r"set rows\.skip_lines"),
        ("t,motor,x,y,z\n", r"names: a; it has others: motor"),
    ],
)
def test_a_log_without_the_named_columns_says_what_it_has(tmp_path, head, told):
    with pytest.raises(LogError, match=told):
        read(tmp_path / "log.csv", head + rows(range(3)))


def test_an_end_without_position_says_why_it_needs_one():
    text = MAP.replace('position = ["x", "y", "z"]', 'axis = ["x", "y", "z"]')
    with pytest.raises(LogError, match="angles alone do not show"):
        map_from_toml(text)


def test_files_are_joined_row_by_row(tmp_path):
    log_map = map_from_toml(MAP + '[join]\nby = "row"\n')
    paths = [tmp_path / "motors.csv", tmp_path / "ends.csv"]
    paths[0].write_text("t,a\n0,5\n0.1,6\n")
    paths[1].write_text("x,y,z\n1,2,3\n4,5,6\n")
    take = _read_takes(paths, log_map)[0]
    np.testing.assert_allclose(take.commanded[:, 0], [5e-3, 6e-3])
    np.testing.assert_allclose(take.positions[1, 0], [4e-3, 5e-3, 6e-3])
    paths[1].write_text("x,y,z\n1,2,3\n")
    with pytest.raises(
        LogError, match=r"motors\.csv has 2 rows, .*ends\.csv has 1 row;"
    ):
        _read_takes(paths, log_map)


def test_too_short_a_log_is_called_short(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t,a,x,y,z\n" + rows(np.arange(4) / 10))
    with pytest.raises(LogError, match=r"of 4 rows.*give a longer log"):
        import_logs([path], map_from_toml(MAP))
