"""Logs that miss what an import needs: what to do is said, and is true."""

import numpy as np
import pytest

from s2c2a.logs import import_logs, map_from_toml
from s2c2a.logs.errors import LogError
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


def read(path, text: str = MAP):
    return _read_takes([path], map_from_toml(text))[0]


def test_times_of_day_pass_midnight(written):
    times = ["23:59:59.900", "00:00:00.000", "00:00:00.100"]
    take = read(written("t,a,x,y,z\n" + rows(times)))
    np.testing.assert_allclose(np.diff(take.time), 0.1)


@pytest.mark.parametrize("time", ["52:45.5", "31/01/2026 11:33:04"])
def test_another_form_of_times_names_those_that_are_read(written, time):
    with pytest.raises(LogError, match=r"is no time; write .*11:33:04.*ISO 8601"):
        read(written("t,a,x,y,z\n" + rows([time, time])))


def test_text_of_western_windows_programs_is_read(written):
    path = written(("t,a [°],x,y,z\n" + rows(range(3))).encode("cp1252"))
    assert len(read(path, MAP.replace('"a"', '"a [°]"'))) == 3


@pytest.mark.parametrize(
    ("head", "told"),
    [
        ("logger 3\n\nt,a,x,y,z\n", r"set rows\.skip_lines"),
        ("t,motor,x,y,z\n", r"names: a; it has others: motor"),
    ],
)
def test_a_log_without_the_named_columns_says_what_it_has(written, head, told):
    with pytest.raises(LogError, match=told):
        read(written(head + rows(range(3))))


def test_an_end_without_position_says_why_it_needs_one():
    text = MAP.replace('position = ["x", "y", "z"]', 'axis = ["x", "y", "z"]')
    with pytest.raises(LogError, match="angles alone do not show"):
        map_from_toml(text)


def test_files_are_joined_row_by_row(written):
    log_map = map_from_toml(MAP + '[join]\nby = "row"\n')
    paths = [
        written("t,a\n0,5\n0.1,6\n", "motors.csv"),
        written("x,y,z\n1,2,3\n4,5,6\n", "ends.csv"),
    ]
    take = _read_takes(paths, log_map)[0]
    np.testing.assert_allclose(take.commanded[:, 0], [5e-3, 6e-3])
    np.testing.assert_allclose(take.positions[1, 0], [4e-3, 5e-3, 6e-3])
    written("x,y,z\n1,2,3\n", "ends.csv")
    told = r"motors\.csv has 2 rows, .*ends\.csv has 1 row;"
    with pytest.raises(LogError, match=told):
        _read_takes(paths, log_map)


def test_too_short_a_log_is_called_short(written):
    path = written("t,a,x,y,z\n" + rows(np.arange(4) / 10))
    with pytest.raises(LogError, match=r"of 4 rows.*give a longer log"):
        import_logs([path], map_from_toml(MAP))
