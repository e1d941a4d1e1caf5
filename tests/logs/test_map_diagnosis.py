"""Wrong frames, ends, drives, and units of a map are named, and never corrected."""

import tomllib

import numpy as np
import pytest
from simulated_logs import (  # type: ignore[import-not-found]
    BASE,
    FRAME,
    record,
    write_log,
)

from s2c2a.arm import load_arm
from s2c2a.errors import S2C2AError
from s2c2a.logs import LogMap, import_logs

from marks import slow_after

TWIN = load_arm("twin_arm")
ARM = TWIN.model_copy(update={"name": "two", "modules": TWIN.modules[:2]})


STRAIGHT = np.eye(3)


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    folder = tmp_path_factory.mktemp("log")
    recording = record(folder / "two.episodes", ARM, 200)
    return write_log(folder, recording, tip_only=False, signs_stated=True)


@pytest.fixture
def table(log):
    """Map that states the frame along the log's axes, and all of the drives."""
    table = tomllib.loads(log.map)
    del table["arm"]["length"]
    table["arm"]["lengths"] = [module.length for module in ARM.modules]
    table["frame"] = {"along": "z", "x": "x", "base": [0.0, 0.0, 0.0]}
    angles = np.concatenate([module.cable_angles_deg for module in ARM.modules])
    for drive, cable in zip(table["drives"], log.order, strict=True):
        drive["module"] = int(cable // ARM.cable_count)
        drive["angle_deg"] = float(angles[cable])
    return table


@pytest.fixture
def outcome(log, tmp_path):
    """What an import of transformed ends with 1 mm of noise says of the map."""

    def run(table, transform=STRAIGHT, noise=0.001):
        names = log.path.read_text().splitlines()[0].split(",")
        values = np.loadtxt(log.path, delimiter=",", skiprows=1)
        ends = [names.index(f"{axis}{module}") for module in (0, 1) for axis in "xyz"]
        positions = FRAME.inv().apply(values[:, ends].reshape(-1, 3) - BASE)
        positions += noise * np.random.default_rng(1).normal(size=positions.shape)
        values[:, ends] = (positions @ transform.T).reshape(len(values), -1)
        path = tmp_path / "log.csv"
        np.savetxt(path, values, "%.7g", ",", header=",".join(names), comments="")
        try:
            imported = import_logs([path], LogMap.model_validate(table))
            return imported.diagnosis + imported.contradictions
        except S2C2AError as error:
            return str(error)

    return run


@pytest.mark.slow
def test_a_left_handed_frame_is_named_and_the_advice_mends_it(table, outcome):
    mirror = np.diag([1.0, -1.0, 1.0])
    assert "left-handed: negate the column 'y0'" in outcome(table, mirror)
    assert outcome(table) == ""


@pytest.mark.slow
def test_a_mirror_image_of_free_angles_is_not_blamed(table, outcome):
    for drive in table["drives"]:
        del drive["angle_deg"]
    assert outcome(table, np.diag([1.0, -1.0, 1.0])) == ""


@pytest.mark.slow
def test_exchanged_columns_are_named(table, outcome):
    for end in table["ends"]:
        x, y, z = end["position"]
        end["position"] = [x, z, y]
    assert "exchange the columns 'z0' and 'y0'" in outcome(table)


@pytest.mark.slow
def test_angles_that_no_single_change_explains_are_contradicted(table, outcome):
    names = []
    for module in (0, 1):
        first, second = [one for one in table["drives"] if one["module"] == module][:2]
        first["angle_deg"], second["angle_deg"] = (
            second["angle_deg"],
            first["angle_deg"],
        )
        names += [first["measured"], second["measured"]]
    text = outcome(table)
    assert "the log contradicts stated angles" in text
    assert any(f"'{name}' by" in text for name in names)


@pytest.mark.slow
def test_exchanged_drives_are_named(table, outcome):
    first, second = [drive for drive in table["drives"] if drive["module"] == 1][:2]
    first["angle_deg"], second["angle_deg"] = second["angle_deg"], first["angle_deg"]
    names = f"of '{first['measured']}' and '{second['measured']}'"
    assert f"exchange module, angle_deg {names}" in outcome(table)


@pytest.mark.slow
def test_exchanged_modules_are_named(table, outcome):
    for drive in table["drives"]:
        drive["module"] = 1 - drive["module"]
    assert "reverse the order of the drives' `module`" in outcome(table)


@pytest.mark.slow
def test_exchanged_ends_are_named(table, outcome):
    table["ends"][0]["module"] = 1
    table["ends"][1]["module"] = 0
    assert "write module = 0 for the end 'x0'" in outcome(table)


@pytest.mark.slow
@pytest.mark.parametrize(("unit", "factor"), slow_after(1, [("mm", 1.0), ("m", 1e3)]))
def test_a_wrong_unit_of_the_ends_is_named(table, outcome, unit, factor):
    for end in table["ends"]:
        end["unit"] = unit
    right = {"mm": "m", "m": "mm"}[unit]
    text = outcome(table, factor * np.eye(3))
    assert f'write unit = "{right}" for the ends' in text


@pytest.mark.slow
def test_degrees_for_radians_are_named(table, outcome):
    # columns in mm, as angles [rad] of a pulley of 1 mm
    table["arm"]["pulley_radius"] = 0.001
    for drive in table["drives"]:
        drive["unit"] = "rad"
    assert outcome(table) == ""
    for drive in table["drives"]:
        drive["unit"] = "deg"
    assert 'write unit = "rad" for the drives' in outcome(table)
