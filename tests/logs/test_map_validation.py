"""Validation of maps: errors name the key."""

import re
from pathlib import Path

import pytest

from s2c2a.logs import map_from_toml
from s2c2a.logs.errors import LogError

VALID = """
[rows]
kind = "steps"
[arm]
name = "mine"
modules = 1
control_rate = 10
[[drives]]
commanded = "m1"
unit = "mm"
[[ends]]
position = ["x", "y", "z"]
unit = "mm"
"""


def test_a_column_of_two_ends_is_an_error():
    end = VALID[VALID.index("[[ends]]") :].replace('"x"', '"u"')
    two = VALID.replace("modules = 1", "modules = 2") + f"{end}module = 0\n"
    with pytest.raises(LogError, match="name each column of the ends once"):
        map_from_toml(two)


def test_a_short_map_of_a_slow_log_is_enough():
    log_map = map_from_toml(VALID.replace("control_rate = 10", "control_rate = 0.01"))
    assert log_map.end_modules == [0]
    assert log_map.number_columns == {"m1", "x", "y", "z"}


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "commanded",
            "comanded",
            "drives.0.comanded: no such key; did you mean commanded",
        ),
        ('commanded = "m1"', "", "drives.0: name a column"),
        ('unit = "mm"\n[[ends', 'unit = "ticks"\n[[ends', "arm.pulley_radius"),
        ('unit = "mm"\n[[ends', 'unit = "free"\n[[ends', "arm.cable_radius"),
        ('kind = "steps"', 'kind = "timed"', "rows: timed rows need"),
        ("modules = 1", "modules = 99", "arm.modules"),
        ('position = ["x", "y", "z"]', 'position = ["x"]', "ends.0.position"),
        ("[[ends]]", '[[ends]]\nquaternion = ["a", "b", "c", "d"]', "order"),
        ("[[ends]]", '[[ends]]\neuler = ["a", "b", "c"]', "sequence"),
        (
            "[[ends]]",
            '[[ends]]\neuler = ["a", "b", "c"]\nsequence = "xYz"',
            "ends.0.sequence",
        ),
        ("[[ends]]", "[[ends]]\nmodule = 1", "ends name a module beyond"),
        (
            "[[ends]]",
            '[[ends]]\nposition = ["u", "v", "w"]\nunit = "m"\n[[ends]]',
            "one end",
        ),
        ("control_rate = 10", "", "arm.control_rate: this key is missing"),
        ("control_rate = 10", "control_rate = 10\nlength = nan", "arm.length"),
        (
            "[[ends]]",
            "[frame]\nalong = 3\n[[ends]]",
            "frame.along: 3 is no direction; write x, y, z, -x, -y or -z, in quotes",
        ),
        (
            "[[ends]]",
            '[frame]\nx = "down"\n[[ends]]',
            "x, y and z are the first, second and third column of `position`",
        ),
        (
            "[[ends]]",
            "[frame]\nalong = [0, 0, 0]\n[[ends]]",
            "frame.along: [0, 0, 0] is no direction",
        ),
        (
            "[[ends]]",
            "[frame]\nalong = [0, 1]\n[[ends]]",
            "frame.along: [0, 1] is no direction",
        ),
        ("[[ends]]", '[[ends]]\nalong = "up"', "ends.0.along: 'up' is no direction"),
        (
            "[rows]",
            '[rows]\noutliers = "hide"',
            "rows.outliers: write 'exclude' or 'keep'",
        ),
        ("[[ends]]", "[frame]\nstr = 3\n[[ends]]", "frame.str: no such key"),
        ("[rows]", "[rows", "not valid TOML"),
    ],
)
def test_an_error_names_its_key(old, new, message):
    assert old in VALID
    with pytest.raises(LogError, match=re.escape(message)):
        map_from_toml(VALID.replace(old, new, 1))


def test_the_documented_map_fits_the_documented_log():
    guides = Path(__file__).parents[2] / "docs" / "guides"
    page = (guides / "import.md").read_text(encoding="utf-8")
    log = re.findall(r"```csv\n(.*?)```", page, re.DOTALL)[0]
    text = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)[0]
    assert map_from_toml(text).number_columns <= set(log.splitlines()[0].split(";"))


@pytest.mark.parametrize("along", ['"-y"', '"+x"', "[0, 0, 1]", "[0.0, -0.6, 0.8]"])
def test_directions_are_signed_axes_or_vectors(along):
    log_map = map_from_toml(f"{VALID}along = {along}\n[frame]\nalong = {along}\n")
    assert log_map.frame.along == log_map.ends[0].along


def test_errors_are_plain_language():
    text = VALID.replace("modules = 1", "modules = 'three'")
    with pytest.raises(LogError) as caught:
        map_from_toml(text.replace("control_rate = ", "control_rate = -"))
    message = str(caught.value)
    assert "arm.modules: write a whole number (got 'three')" in message
    assert "arm.control_rate: write 0.01 or more" in message
    assert "Input" not in message
