"""Another take of an arm is imported with the rig of the first one."""

import json
from dataclasses import replace

import numpy as np
import pytest
from simulated_logs import record, write_log  # type: ignore[import-not-found]

from s2c2a.logs import import_logs, import_take, map_from_toml, summary
from s2c2a.logs.errors import LogError
from s2c2a.logs.rig import Rig


@pytest.fixture(scope="module")
def first(twin, tmp_path_factory):
    """Log, and a recording as an import makes it."""
    folder = tmp_path_factory.mktemp("first")
    recording = record(folder / "twin.episodes", twin, 30)
    log = write_log(folder, recording, tip_only=False, signs_stated=True)
    order = np.arange(9).reshape(3, 3)
    rig = Rig.identified(
        map_from_toml(log.map),
        np.zeros(9),
        order,
        np.ones((3, 3)),
        np.zeros(3),
        np.eye(3),
    )
    options = {"rig": json.loads(json.dumps(rig.model_dump()))}
    return log, replace(recording, options=options)


def with_rig(recording, rig):
    return replace(recording, options={"rig": rig})


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"m0"', '"m1"', "the drives: m1"),
        ('"mm"', '"m"', "meters or newtons per unit of 'm0': 1.0 in the map, 0.001 in"),
        ("= 10", "= 20", "control_rate: 20.0 in the map, 10.0 in the arm or recording"),
    ],
)
def test_a_map_of_another_arm_or_other_units_is_refused(old, new, message, first):
    log, recording = first
    changed = map_from_toml(log.map.replace(old, new, 1))
    with pytest.raises(LogError, match=message):
        import_take([log.path], changed, recording)


@pytest.mark.slow
def test_a_drive_that_winds_more_cable_than_the_arm_is_long_is_refused(first):
    log, _ = first
    text = log.map.replace('"m3"\nunit = "mm"', '"m3"\nunit = "m"')
    with pytest.raises(LogError, match=r"'m3' moves by .* correct its unit"):
        import_logs([log.path], map_from_toml(text))


def test_ends_beyond_the_reach_of_the_arm_are_refused(first):
    log, recording = first
    rig = {**recording.options["rig"], "base": [40.0, 0.0, 0.0]}
    with pytest.raises(LogError, match=r"ends are up to 40.* correct their unit"):
        import_take([log.path], map_from_toml(log.map), with_rig(recording, rig))


def test_an_arm_that_differs_from_the_map_is_refused(first, twin):
    log, _ = first
    log_map = map_from_toml(log.map)
    for change in ({"control_rate": 50.0}, {"modules": twin.modules[:2]}):
        arm = twin.model_copy(update=change)
        with pytest.raises(LogError, match=f"{next(iter(change))}: .* in the map"):
            import_logs([log.path], log_map, arm)


@pytest.mark.parametrize(
    "change",
    [
        {},
        {"names": 5},
        {"drive": [[0, 1], [0]]},
        {"drive": [[0, 1, 99], [3, 4, 5], [6, 7, 8]]},
        {"drive": [[0, 1, -1], [3, 4, 5], [6, 7, 8]]},
        {"drive": [], "factor": []},
        {"factor": [[1e400] * 3] * 3},
        {"base": [0.0, 0.0, float("nan")]},
        {"axes": [[1.0, 0.0, 0.0]] * 3},
    ],
)
def test_a_recording_without_a_valid_rig_is_refused(change, first):
    log, recording = first
    rig = {**recording.options["rig"], **change} if change else None
    with pytest.raises(LogError, match="import its logs again, without --like"):
        import_take([log.path], map_from_toml(log.map), with_rig(recording, rig))


def test_takes_without_a_measured_tip_are_not_compared(first):
    log, recording = first
    take = import_take([log.path], map_from_toml(log.map), recording)
    lines = summary.take_summary(replace(take, change=None))
    assert "cannot be checked" in lines[-1]
