import copy
import tomllib

import pytest
import tomli_w
from pydantic import ValidationError

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


def without(description: dict, path: str) -> str:
    module, key = path.split(".")[1:]
    changed = copy.deepcopy(description)
    del changed["modules"][int(module)][key]
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


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("modules.0.length", 200.0),
        ("modules.0.length", 0.0002),
        ("modules.1.cable_radius", 27.0),
        ("modules.1.cable_radius", 0.000027),
        ("modules.2.mass", 75.0),
        ("modules.2.mass", 0.000075),
        ("modules.0.bending_stiffness", 160.0),
        ("modules.0.bending_stiffness", 0.00016),
        ("modules.0.cable.stiffness", 6.0),
        ("modules.0.cable.stiffness", 6e6),
        ("modules.0.cable.backlash", 0.5),
        ("motor.pulley_radius", 10.0),
        ("control_rate", 10000.0),
    ],
)
def test_a_value_off_by_a_thousand_is_refused_with_its_path_and_a_hint(path, value):
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


@pytest.mark.parametrize(
    "matrix",
    [[[1.0, 0.0], [0.0, 1.0]], [[1.0] * 3, [1.0] * 3], [[1.0] * 3, [1.0] * 3, [1.0]]],
)
def test_a_sensing_coupling_that_is_not_square_over_the_modules_is_refused(matrix):
    fault = fault_in(with_value(TWIN, "sensing_coupling", matrix))
    assert "one row and one column for each of the 3 modules" in fault


def test_only_eight_cables_are_allowed():
    assert "modules.1.cable_angles_deg: give at most 8" in fault_in(
        with_value(
            TWIN, "modules.1.cable_angles_deg", [40.0 * cable for cable in range(9)]
        )
    )


@pytest.mark.parametrize(
    ("angles", "gap"),
    [
        ([0.0, 60.0, 181.0], 179),
        ([0.0, 10.0, 20.0], 340),
        ([5.0, 5.0, 5.0], 360),
        ([-90, 0, 90], 180),
    ],
)
def test_cables_that_cannot_bend_every_way_are_refused(angles, gap):
    fault = fault_in(with_value(TWIN, "modules.0.cable_angles_deg", angles))
    assert "modules.0: " in fault
    assert f"a gap of {gap} deg" in fault


def test_cables_that_just_bend_every_way_are_allowed():
    arm = arm_from_toml(
        with_value(TWIN, "modules.0.cable_angles_deg", [0.0, 60.0, 181.5])
    )
    assert arm.modules[0].cable_angles_deg == (0.0, 60.0, 181.5)


def test_a_tension_arm_needs_its_tension_range():
    assert "modules.1.tension_range is missing" in fault_in(
        without(SIMULATED, "modules.1.tension_range")
    )


@pytest.mark.parametrize(("key", "value"), [("backlash", 0.001), ("creep", 0.2)])
def test_a_tension_arm_has_neither_backlash_nor_creep(key, value):
    fault = fault_in(with_value(SIMULATED, "modules.2.cable", {key: value}))
    assert "modules.2.cable has backlash or creep" in fault


@pytest.mark.parametrize(
    "direction", [[0.0, 0.0, -9.81], [1.0, 1.0, 0.0], [0.0, 0.0, 0.5]]
)
def test_a_gravity_direction_that_is_not_a_unit_vector_is_refused(direction):
    assert "give a unit vector" in fault_in(
        with_value(TWIN, "gravity_direction", direction)
    )


def test_cables_further_out_than_the_module_is_long_are_refused():
    assert "modules.0: cable_radius" in fault_in(
        with_value(TWIN, "modules.0.cable_radius", 0.25)
    )


def test_a_motor_speed_in_millimetres_is_refused_on_a_displacement_arm():
    assert "motor.speed_limit 200.0 m/s exceeds 5 m/s" in fault_in(
        with_value(TWIN, "motor.speed_limit", 200.0)
    )


@pytest.mark.parametrize("name", ["", "my arm", "../arm", "-arm", "a" * 65])
def test_a_name_that_is_no_plain_word_is_refused(name):
    assert "  name: " in fault_in(with_value(TWIN, "name", name))


@pytest.mark.parametrize("count", [0, 21])
def test_an_arm_has_one_to_twenty_modules(count):
    assert "modules: give at" in fault_in(
        with_value(TWIN, "modules", TWIN["modules"][:1] * count)
    )


def test_an_unknown_actuation_is_refused_with_the_choices():
    assert "actuation: write 'displacement', 'tension' or 'pressure'" in fault_in(
        with_value(TWIN, "actuation", "air")
    )


def test_every_fault_is_listed_at_once():
    fault = fault_in(
        with_value(
            TWIN, "modules.0", {**TWIN["modules"][0], "mass": 75.0, "lenth": 0.2}
        )
    )
    assert "2 fault(s)" in fault
    assert "modules.0.mass" in fault
    assert "modules.0.lenth" in fault


@pytest.mark.parametrize(
    "path",
    ["name", "modules.0.length", "modules.0.cable.stiffness", "motor.pulley_radius"],
)
def test_a_built_arm_cannot_be_changed(path):
    *parents, key = path.split(".")
    place = load_arm("twin_arm")
    for parent in parents:
        place = place[int(parent)] if parent.isdigit() else getattr(place, parent)
    with pytest.raises(ValidationError, match="frozen"):
        setattr(place, key, getattr(place, key))


def test_equal_arms_are_equal_keys():
    arms = {load_arm("twin_arm"), ArmSpec.model_validate(TWIN)}
    assert arms == {load_arm("twin_arm")}
