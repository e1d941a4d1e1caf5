import copy
import tomllib

import pytest
import tomli_w

from s2c2a.arm import ArmSpec, arm_from_toml, arm_to_toml, load_arm
from s2c2a.errors import ArmError

TWIN = tomllib.loads(arm_to_toml(load_arm("twin_arm")))
SIMULATED = tomllib.loads(arm_to_toml(load_arm("simulated_arm")))


def with_value(description: dict, path: str, value) -> str:
    """Return an arm file with one value set at a dotted path, which may be new."""
    changed = copy.deepcopy(description)
    *parents, key = [int(part) if part.isdigit() else part for part in path.split(".")]
    place = changed
    for parent in parents:
        is_list = isinstance(place, list)
        place = place[parent] if is_list else place.setdefault(parent, {})
    place[key] = value
    return tomli_w.dumps(changed)


def fault_in(text: str) -> str:
    with pytest.raises(ArmError) as caught:
        arm_from_toml(text, source="my_arm.toml")
    return str(caught.value)


@pytest.mark.parametrize(
    "path",
    ["modules.0.lenth", "modules.2.cable.stifness", "motor.pully_radius", "gravity"],
)
def test_an_unknown_key_is_named_with_its_path(path):
    fault = fault_in(with_value(TWIN, path, 0.2))
    assert f"{path}: no such key" in fault
    assert fault.startswith("my_arm.toml")


OFF_BY_A_THOUSAND = {
    "modules.0.length": (200.0, 0.0002),
    "modules.1.cable_radius": (27.0, 0.000027),
    "modules.2.mass": (75.0, 0.000075),
    "modules.0.bending_stiffness": (160.0, 0.00016),
    "modules.0.cable.stiffness": (6.0, 6e6),
    "modules.0.cable.backlash": (0.5,),
    "motor.pulley_radius": (10.0,),
    "control_rate": (10000.0,),
}


@pytest.mark.parametrize(("path", "values"), OFF_BY_A_THOUSAND.items())
def test_a_value_off_by_a_thousand_is_refused_with_its_path_and_a_hint(path, values):
    for value in values:
        fault = fault_in(with_value(TWIN, path, value))
        assert f"  {path}: " in fault
        assert f"(got {value})" in fault
        assert "factor of 1000" in fault


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -0.2, 0.0])
def test_a_length_that_is_no_positive_number_is_refused(value):
    assert "modules.0.length" in fault_in(with_value(TWIN, "modules.0.length", value))


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("modules.1.cable_angles_deg", [0.0, 1e9, 240.0]),
        ("modules.1.mismatch.rest_azimuth_deg", 1e9),
        ("modules.1.mismatch.stiff_direction_deg", -1e9),
        ("modules.1.mismatch.relaxation_times", [1e9, 1.0]),
        ("sensing_coupling", [[1e9, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
        ("sensors.flex.angles_deg", [1e9]),
    ],
)
def test_a_number_without_a_range_of_its_own_is_finite_in_single_precision(path, value):
    assert f"  {path}" in fault_in(with_value(TWIN, path, value))


@pytest.mark.parametrize(
    "path",
    [
        "modules.0.length",
        "motor.noise_ticks",
        "control_rate",
        "modules.1.cable.stiffness",
    ],
)
@pytest.mark.parametrize("value", ["0.2", "many", True])
def test_text_and_booleans_are_not_numbers(path, value):
    fault = fault_in(with_value(TWIN, path, value))
    assert f"  {path}: " in fault
    assert "a number is needed" in fault


SQUARE = "one row and one column for each of the 3 modules"
SLIPS = "modules.2.cable has backlash or creep"
UNIT = "give a unit vector"
GAPS = {
    179: [0.0, 60.0, 181.0],
    340: [0.0, 10.0, 20.0],
    360: [5.0, 5.0, 5.0],
    180: [-90.0, 0.0, 90.0],
}
GAP = "modules.0: cable_angles_deg {} leave a gap of {} deg"
REFUSED = [
    ("sensing_coupling", [[1.0, 0.0], [0.0, 1.0]], SQUARE),
    ("sensing_coupling", [[1.0] * 3, [1.0] * 3], SQUARE),
    ("sensing_coupling", [[1.0] * 3, [1.0] * 3, [1.0]], SQUARE),
    ("modules.1.cable_angles_deg", [0.0] * 9, "1.cable_angles_deg: give at most 8"),
    *(
        ("modules.0.cable_angles_deg", angles, GAP.format(angles, gap))
        for gap, angles in GAPS.items()
    ),
    ("gravity_direction", [0.0, 0.0, -9.81], UNIT),
    ("gravity_direction", [1.0, 1.0, 0.0], UNIT),
    ("gravity_direction", [0.0, 0.0, 0.5], UNIT),
    ("modules.0.cable_radius", 0.25, "modules.0: cable_radius"),
    ("motor.speed_limit", 200.0, "motor.speed_limit 200.0 m/s exceeds 5 m/s"),
    *(("name", name, "  name: ") for name in ("", "my arm", "../arm", "-a", "a" * 65)),
    ("modules", [], "modules: give at"),
    ("modules", TWIN["modules"][:1] * 21, "modules: give at"),
    ("actuation", "air", "write 'displacement', 'tension' or 'pressure'"),
]


@pytest.mark.parametrize(("path", "value", "told"), REFUSED)
def test_what_no_arm_can_have_is_refused_with_the_reason(path, value, told):
    assert told in fault_in(with_value(TWIN, path, value))


@pytest.mark.parametrize(("key", "value"), [("backlash", 0.001), ("creep", 0.2)])
def test_a_tension_arm_has_neither_backlash_nor_creep(key, value):
    assert SLIPS in fault_in(with_value(SIMULATED, "modules.2.cable", {key: value}))


def test_cables_that_just_bend_every_way_are_allowed():
    angles = (0.0, 60.0, 181.5)
    arm = arm_from_toml(with_value(TWIN, "modules.0.cable_angles_deg", list(angles)))
    assert arm.modules[0].cable_angles_deg == angles


def test_a_tension_arm_needs_its_tension_range():
    module = {**SIMULATED["modules"][1]}
    del module["tension_range"]
    fault = fault_in(with_value(SIMULATED, "modules.1", module))
    assert "modules.1.tension_range is missing" in fault


def test_every_fault_is_listed_at_once():
    module = {**TWIN["modules"][0], "mass": 75.0, "lenth": 0.2}
    fault = fault_in(with_value(TWIN, "modules.0", module))
    assert "2 faults" in fault
    assert "modules.0.mass" in fault
    assert "modules.0.lenth" in fault


def test_equal_arms_are_equal_keys():
    arms = {load_arm("twin_arm"), ArmSpec.model_validate(TWIN)}
    assert arms == {load_arm("twin_arm")}
