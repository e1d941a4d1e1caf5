"""The keys of an arm file match the description and are complete."""

import tomllib

from s2c2a.arm import arm_to_toml, file_keys, load_arm


def by_name() -> dict:
    return {(key.table, key.name): key for key in file_keys()}


def test_every_key_of_a_complete_file_is_documented():
    written = tomllib.loads(arm_to_toml(load_arm("twin_arm")))
    module = written["modules"][0]
    tables = {
        "": written,
        "[motor]": written["motor"],
        "[[modules]]": module,
        "[modules.cable]": module["cable"],
    }
    found = {(table, name) for table, values in tables.items() for name in values}
    assert found - {("", "motor"), ("[[modules]]", "cable")} <= by_name().keys()
    assert all(key.meaning and key.allowed for key in file_keys())


def test_documented_ranges_and_defaults_match_the_description():
    keys = by_name()
    assert keys["[modules.cable]", "stiffness"][2:4] == ("50 to 1000000", "100000")
    angles = keys["[[modules]]", "cable_angles_deg"]
    assert angles[2:4] == ("up to 8 numbers", "required")
    kinds = '"encoders", "true" or "file.py:Name"'
    assert keys["", "sensing"][2:4] == (kinds, '"encoders"')
    assert keys["", "gravity_direction"][2:4] == ("3 numbers", "[0, 0, -1]")
    assert keys["[[modules]]", "tension_range"].otherwise == "none"
    assert keys["[motor]", "ticks_per_turn"].allowed == "whole, 16 to 16777216"
    assert keys["", "modules"][2:4] == ("1 to 20 tables", "required")
    assert keys["", "coupled_cables"][2:4] == ("true or false", "false")
