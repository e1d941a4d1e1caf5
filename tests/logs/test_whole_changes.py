"""Signs of all drives, and `along`, are compared with their alternatives."""

import numpy as np
import pytest
from cable_parameters import (  # type: ignore[import-not-found]
    straight_arm,
    wiring_of,
)

from s2c2a.errors import S2C2AError
from s2c2a.kinematics import states_from_bends
from s2c2a.logs import LogMap, import_logs
from s2c2a.logs.map_changes import other_directions, reversed_modules
from s2c2a.logs.model_fit import predict_states

from marks import slow_after


def map_of(positive="pulls", along="z", drives=3, length=0.2, **drive):
    """Map of one module, with free angles and a free turn about its axis."""
    entries = [
        {"commanded": f"c{index}", "unit": "free", "positive": positive, **drive}
        for index in range(drives)
    ]
    return LogMap.model_validate(
        {
            "rows": {"kind": "steps"},
            "arm": {
                "name": "arm",
                "modules": 1,
                "control_rate": 5,
                "length": length,
                "cable_radius": 0.01,
            },
            "frame": {"along": along},
            "drives": entries,
            "ends": [{"position": ["x", "y", "z"], "unit": "m"}],
        }
    )


@pytest.fixture(scope="module")
def write(tmp_path_factory):
    """Function that writes the tip with 1 mm of noise, from a base off the origin."""

    def write(columns, states):
        ends = states[:, 0, :3] + np.array([0.1, 0.2, 0.3])
        ends += 1e-3 * np.random.default_rng(1).normal(size=ends.shape)
        path = tmp_path_factory.mktemp("log") / "log.csv"
        names = [*(f"c{index}" for index in range(columns.shape[1])), *"xyz"]
        table = np.hstack([columns, ends])
        np.savetxt(path, table, "%.6f", ",", header=",".join(names), comments="")
        return path

    return write


@pytest.fixture(scope="module")
def log(write):
    """Log of three cables, of which those that are released go slack."""
    columns = np.random.default_rng(0).uniform(-0.7, 0.7, (200, 3))
    parameters = straight_arm([0.2])
    _, states = predict_states(parameters, wiring_of(1), columns, False)
    return write(columns, states)


def outcome(log, log_map):
    """Diagnosis, or the text of the error."""
    try:
        return import_logs([log], log_map).diagnosis
    except S2C2AError as error:
        return str(error)


@pytest.mark.parametrize(
    ("changes", "advice"),
    slow_after(
        2,
        [
            ({}, ""),
            ({"positive": "releases"}, "reverse `positive` of each drive"),
            ({"along": "-z"}, 'write frame.along = "z"'),
            ({"along": "x"}, 'write frame.along = "z"'),
            ({"length": 0.6}, "correct arm.length"),
            ({"along": "y"}, 'write frame.along = "z"'),
        ],
    ),
)
def test_what_concerns_all_drives_or_ends_is_named(log, changes, advice):
    text = outcome(log, map_of(**changes))
    assert advice in text
    assert bool(text) == bool(advice)


@pytest.mark.parametrize("positive", slow_after(1, ["releases", "pulls"]))
def test_signs_that_equal_half_a_turn_of_a_free_frame_are_not_blamed(write, positive):
    bends = np.random.default_rng(0).uniform(-0.7, 0.7, (200, 2))
    states = np.array(states_from_bends(bends[:, None], np.array([0.2])))
    log = write(bends, states)
    pairs = [{"turn_deg": 0.0}, {"turn_deg": 180.0, "sign": -1}]
    assert outcome(log, map_of(positive, drives=2, cables=pairs)) == ""


def test_the_direction_that_the_ends_show_is_an_alternative_to_another_one():
    up = np.array([0.0, 0.0, 1.0])
    assert not other_directions(map_of(), up)
    assert [clause for clause, _ in other_directions(map_of(), -up)] == [
        'write frame.along = "-z"'
    ]


def test_modules_that_count_from_the_tip_have_the_reversed_order():
    table = map_of(drives=3).model_dump(mode="json", exclude_unset=True)
    table["arm"]["modules"] = 3
    for module, drive in enumerate(table["drives"]):
        drive["module"] = module
    table["drives"][2]["module"] = None
    _, changed = reversed_modules(LogMap.model_validate(table))
    assert [drive.module for drive in changed.drives] == [2, 1, None]


@pytest.mark.slow
def test_modules_in_the_reversed_order_are_named_where_a_fit_makes_up_for_it(tmp_path):
    columns = np.random.default_rng(0).uniform(-0.7, 0.7, (300, 6))
    parameters = straight_arm([0.2, 0.1])
    _, states = predict_states(parameters, wiring_of(2), columns, False)
    ends = np.array(states)[..., :3].reshape(-1, 6)
    ends += 1e-3 * np.random.default_rng(1).normal(size=ends.shape)
    names = [*(f"c{index}" for index in range(6)), *"abcxyz"]
    table, path = np.hstack([columns, ends]), tmp_path / "log.csv"
    np.savetxt(path, table, "%.6f", ",", header=",".join(names), comments="")
    stated = map_of(drives=6, length=None).model_dump(mode="json", exclude_unset=True)
    stated["arm"] |= {"modules": 2, "lengths": [0.2, 0.1]}
    for index, drive in enumerate(stated["drives"]):
        drive["module"] = 1 - index // 3
    stated["ends"] = [
        {"position": list(names), "unit": "m", "module": module}
        for module, names in enumerate(("abc", "xyz"))
    ]
    text = outcome(path, LogMap.model_validate(stated))
    assert "reverse the order of the drives' `module`" in text
