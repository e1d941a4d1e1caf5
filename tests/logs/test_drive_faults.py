"""A single drive of wrong sign, place or unit is named, and no right one."""

import numpy as np
import pytest

from s2c2a.arm.geometry import cable_matrix
from s2c2a.errors import S2C2AError
from s2c2a.kinematics import states_from_bends
from s2c2a.logs import LogMap, import_logs
from s2c2a.logs.drive_faults import foreign_units, likely_changes
from s2c2a.logs.model_fit import Observations

LENGTHS = np.array([0.2, 0.15])  # m
ANGLES_DEG = (10.0, 130.0, 250.0)
RADIUS = 0.02  # m


def log_map(modules=1, places=False, unit="mm", drives=3):
    """Map of drives that pull, with or without their modules and angles."""
    entries = []
    for index in range(drives * modules):
        entry = {"commanded": f"c{index}", "unit": unit, "positive": "pulls"}
        if places:
            entry["module"] = index // drives
            entry["angle_deg"] = ANGLES_DEG[index % drives]
        entries.append(entry)
    return LogMap.model_validate(
        {
            "rows": {"kind": "steps"},
            "arm": {
                "name": "arm",
                "modules": modules,
                "control_rate": 5,
                "length": float(LENGTHS[:modules].sum()),
                "pulley_radius": 0.01,
            },
            "frame": {"along": "z", "x": "x", "base": [0.0, 0.0, 0.0]},
            "drives": entries,
            "ends": [{"position": ["x", "y", "z"], "unit": "m"}],
        }
    )


def motion(modules=1, drives=3, rows=300):
    """Pulls of all drives [m], and states of the ends, with noise of both."""
    random = np.random.default_rng(3)
    bends = random.uniform(-0.6, 0.6, (rows, modules, 2))
    states = np.array(states_from_bends(bends, LENGTHS[:modules]))
    states[..., :3] += 5e-4 * random.normal(size=states[..., :3].shape)
    matrix = -RADIUS * cable_matrix(np.deg2rad(ANGLES_DEG[:drives]))
    pulls = (bends @ matrix.T).reshape(rows, -1)
    return pulls + 2e-4 * random.normal(size=pulls.shape), states


def observe(columns, states):
    seen = states.copy()
    seen[:, :-1] = np.nan  # the tip alone
    return Observations(columns, seen, np.eye(3), False, {}, 1.0)


@pytest.mark.parametrize("places", [False, True])
@pytest.mark.parametrize("wrong", [0, 4])
def test_the_drive_of_wrong_sign_is_the_most_likely_one(places, wrong):
    columns, states = motion(modules=2)
    stated = log_map(2, places)
    assert not likely_changes(observe(columns, states), stated)
    columns[:, wrong] *= -1
    clause, changed = likely_changes(observe(columns, states), stated)[0]
    assert clause == f"reverse `positive` of 'c{wrong}'"
    assert [drive.positive for drive in changed.drives].count("releases") == 1


def test_exchanged_columns_of_stated_drives_are_the_most_likely_change():
    columns, states = motion(modules=2)
    columns[:, [1, 5]] = columns[:, [5, 1]]
    clause, _ = likely_changes(observe(columns, states), log_map(2, places=True))[0]
    assert clause == "exchange module, angle_deg of 'c1' and 'c5'"


@pytest.mark.parametrize("factor", [1e3, 1e-3])
def test_the_drive_of_another_unit_is_named(factor):
    columns, states = motion(modules=2)
    assert foreign_units(observe(columns, states), log_map(2)) == ("", [])
    columns[:, 2] *= factor
    sentence, (factors,) = foreign_units(observe(columns, states), log_map(2))
    assert sentence.startswith("the unit or scale of 'c2' is wrong")
    assert ("about 0.00" in sentence) == (factor > 1)
    assert 0.3 < factors[2] * factor < 3.0
    assert (np.delete(factors, 2) == 1.0).all()


def test_units_that_resemble_levers_show_where_modules_are_stated():
    columns, states = motion(modules=2)
    columns[:, 4] *= 0.1
    seen = observe(columns, states)
    assert foreign_units(seen, log_map(2))[0] == ""
    assert "of 'c4' is wrong" in foreign_units(seen, log_map(2, places=True))[0]


def test_of_two_drives_in_different_units_both_are_named():
    columns, states = motion(drives=2)
    columns[:, 0] *= 180 / np.pi
    seen = observe(columns, states)
    sentence, factors = foreign_units(seen, log_map(unit="rad", drives=2))
    assert len(factors) == 2
    assert "'c0', 'c1' differ; the log does not tell which is wrong" in sentence


@pytest.mark.parametrize("places", [False, True])
def test_a_drive_that_hardly_moves_is_of_no_foreign_unit(places):
    columns, states = motion(modules=2)
    columns[:, 2] = 1e-6 * np.random.default_rng(0).normal(size=len(columns))
    seen = observe(columns, states)
    stated = log_map(2, places)
    assert foreign_units(seen, stated)[0] == ""
    columns[:, 1] *= 0.001
    sentence, _ = foreign_units(seen, stated)
    assert "'c0'" not in sentence
    assert "'c2'" not in sentence


@pytest.mark.parametrize(
    ("factor", "text"),
    [
        (1.0, ""),
        (-1.0, "the map contradicts the log: reverse `positive` of 'c1'; the model"),
        (1e3, "'c1' moves by 32 m, and the arm is 0.2 m long"),
        (0.02, "the map contradicts the log: the unit or scale of 'c1' is wrong"),
    ],
)
def test_an_import_names_the_wrong_drive_and_no_other(tmp_path, factor, text):
    columns, states = motion()
    columns[:, 1] *= factor
    table = np.hstack([1e3 * columns, states[:, 0, :3]])
    path = tmp_path / "log.csv"
    np.savetxt(path, table, "%.6f", ",", header="c0,c1,c2,x,y,z", comments="")
    try:
        said = import_logs([path], log_map()).diagnosis
    except S2C2AError as error:
        said = str(error)
    assert said.startswith(text)
    assert bool(said) == bool(text)
    assert "'c0'" not in said
    assert "'c2'" not in said
