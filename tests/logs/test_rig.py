"""Another session of an arm is read by what was found in the first, by the same map alone."""

import json
from dataclasses import replace

import numpy as np
import pytest
from simulated_logs import recorded, written  # type: ignore[import-not-found]

from s2c2a.logs import import_again, import_logs, map_from_toml, summary
from s2c2a.logs.errors import LogError
from s2c2a.logs.rig import Rig, nearby


@pytest.fixture(scope="module")
def first(twin, tmp_path_factory):
    """A log, and a recording such as an import makes of it."""
    folder = tmp_path_factory.mktemp("first")
    recording = recorded(folder / "twin.episodes", twin, 30)
    log = written(folder, recording, tip_alone=False, signs_stated=True)
    cables = np.arange(twin.module_count * twin.cable_count).reshape(
        twin.module_count, -1
    )
    rig = Rig.found(
        map_from_toml(log.map), cables, np.ones(cables.shape), np.zeros(3), np.eye(3)
    )
    return log, replace(
        recording, options={"rig": json.loads(json.dumps(rig.model_dump()))}
    )


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('measured = "m0"', 'measured = "m1"', "the drives: m1"),
        (
            'unit = "mm"\n',
            'unit = "m"\n',
            "what turns 'm0' into meters or newtons: 1.0 in the map, 0.001 in",
        ),
        (
            "control_rate = 10",
            "control_rate = 20",
            "control_rate: 20.0 in the map, 10.0 in the arm or recording",
        ),
    ],
)
def test_a_map_of_another_arm_or_other_units_is_refused(old, new, said, first):
    log, recording = first
    assert old in log.map
    with pytest.raises(LogError, match=said):
        import_again([log.log], map_from_toml(log.map.replace(old, new, 1)), recording)


def test_a_drive_that_winds_more_cable_than_the_arm_is_long_is_refused_before_anything_is_fitted(
    first,
):
    log, _ = first
    told = map_from_toml(
        log.map.replace('measured = "m3"\nunit = "mm"', 'measured = "m3"\nunit = "m"')
    )
    with pytest.raises(LogError, match=r"'m3' moves by .* let the map say its unit"):
        import_logs([log.log], told)


def test_ends_that_no_end_of_the_arm_can_be_at_are_refused(first):
    log, recording = first
    rig = {**recording.options["rig"], "base": [40.0, 0.0, 0.0]}
    with pytest.raises(
        LogError, match=r"ends are up to 40.* let the map say their unit"
    ):
        import_again(
            [log.log], map_from_toml(log.map), replace(recording, options={"rig": rig})
        )


def test_an_arm_that_the_map_does_not_tell_of_is_refused_before_anything_is_fitted(
    first, twin
):
    log, _ = first
    for changed in ({"control_rate": 50.0}, {"modules": twin.modules[:2]}):
        with pytest.raises(LogError, match=f"{next(iter(changed))}: .* in the map"):
            import_logs(
                [log.log], map_from_toml(log.map), twin.model_copy(update=changed)
            )


@pytest.mark.parametrize(
    "changed",
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
def test_a_recording_that_does_not_say_how_cameras_stood_is_refused(changed, first):
    log, recording = first
    rig = {**recording.options["rig"], **changed} if changed else None
    with pytest.raises(LogError, match="import its logs anew, without --like"):
        import_again(
            [log.log], map_from_toml(log.map), replace(recording, options={"rig": rig})
        )


def test_rows_whose_cables_stood_alike_tell_that_a_camera_moved():
    random = np.random.default_rng(0)
    cables, tips = random.normal(size=(200, 2, 3)), random.normal(size=(200, 3))
    near = nearby(cables, tips + np.array([0.0, 0.0, 0.01]), cables[::-1], tips[::-1])
    np.testing.assert_allclose(
        near.moved, np.tile([0.0, 0.0, 0.01], (len(near.moved), 1)), atol=1e-9
    )
    assert near.cables.max() == 0.0


def test_where_the_tip_was_not_seen_nothing_is_compared(first):
    log, recording = first
    again = import_again([log.log], map_from_toml(log.map), recording)
    tips = np.full((4, 3), np.nan)
    blind = nearby(np.zeros((4, 3, 3)), tips, np.zeros((4, 3, 3)), np.zeros((4, 3)))
    assert "cannot be told" in summary.summary_again(replace(again, nearby=blind))[-1]
