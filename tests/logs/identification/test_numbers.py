"""Coordinates of numbers in arm files."""

import pytest

from s2c2a.arm import file_keys
from s2c2a.logs.identification.numbers import KINDS, POLAR_KEYS, Unknown, unknowns_of

ALLOWED = {(key.table, key.name): key.allowed for key in file_keys()}


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.key)
def test_a_coordinate_and_its_value_convert_both_ways(kind):
    start = 2.0 * kind.low if kind.ratio else (kind.low + kind.high) / 2
    unknown = Unknown(("number",), kind, start)
    value = unknown.value(0.01)
    assert unknown.value(0.0) == pytest.approx(start)
    assert unknown.coordinate(value) == pytest.approx(0.01)
    change = unknown.value(0.01 + 1e-5) - unknown.value(0.01 - 1e-5)
    assert unknown.slope(0.01) == pytest.approx(change / 2e-5, rel=1e-4)


@pytest.mark.parametrize("keys", POLAR_KEYS, ids=lambda keys: keys.size)
def test_size_and_direction_convert_both_ways(keys):
    table = {keys.size: 1.5, keys.direction: 40.0}
    keys.to_components(table)
    assert len(table[keys.size]) == 2
    keys.to_polar(table)
    assert table == pytest.approx({keys.size: 1.5, keys.direction: 40.0})


def test_tension_drives_have_no_cable_stiffness_or_backlash(make_arm):
    arm = make_arm(modules=1, actuation="tension", module={"tension_range": 5.0})
    names = [unknown.name for unknown in unknowns_of(arm)]
    assert "modules.0.cable.friction" in names
    assert "modules.0.cable.stiffness" not in names
    assert not any("backlash" in name for name in names)


@pytest.mark.parametrize(
    "kind",
    [kind for kind in KINDS if not kind.key.endswith("*")],
    ids=lambda kind: kind.key,
)
def test_a_number_is_searched_in_the_whole_range_that_an_arm_file_allows(kind):
    *tables, name = kind.key.replace("modules.*", "modules").split(".")
    table = ".".join(tables)
    titles = f"[{table}]", f"[[{table}]]"
    allowed = next(ALLOWED[title, name] for title in titles if (title, name) in ALLOWED)
    assert f"{kind.low:.10g} to {kind.high:.10g}" == allowed
