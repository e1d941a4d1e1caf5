"""Model mismatch in arm files: validation, and omission of defaults."""

import tomllib

import numpy as np
import pytest

from s2c2a.arm import (
    ArmGeometry,
    Mismatch,
    arm_from_toml,
    arm_to_toml,
    load_arm,
    preset_names,
)
from s2c2a.errors import ArmError
from s2c2a.runtime import CommandLimits

NEW = {"mismatch", "viscous_friction", "travel"}
NEW |= {"homing_error", "current_noise", "current_friction"}


def with_line(preset: str, table: str, line: str) -> str:
    """A preset's file with one more line in the last table of a name."""
    before, after = arm_to_toml(load_arm(preset)).rsplit(f"{table}\n", 1)
    return f"{before}{table}\n{line}\n{after}"


@pytest.mark.parametrize("name", preset_names())
def test_an_arm_file_without_mismatch_omits_the_table(name):
    """Recordings hold this text, and what is kept is found by it."""
    written = tomllib.loads(arm_to_toml(load_arm(name)))
    cables = [module["cable"] for module in written["modules"]]
    assert not NEW & set().union(written["motor"], *written["modules"], *cables)


def test_mismatch_survives_a_file(make_arm):
    cable = {"backlash": (0.001, 0.0, 0.0005), "viscous_friction": 3.0, "travel": 0.03}
    wrong = Mismatch(coupling=0, radius_errors=(0.1, 0.0, -0.1), relaxing=(0.1, 0.2))
    arm = make_arm(module={"cable": cable, "mismatch": wrong})
    assert arm_from_toml(arm_to_toml(arm)) == arm
    assert arm.differences(make_arm(module={"cable": cable}))


COUNT = "has 2 numbers; give one for each of the 3 cables"
INVALID = {
    "radius_errors = [0.1, 0.2]": f"mismatch.radius_errors {COUNT}",
    "radius_errors = [0.1, 0.2, 0.9]": "mismatch.radius_errors: write 0.5 or less",
    "radius_errors = []": "mismatch.radius_errors: give at least 1",
    'angle_errors_deg = [0.0, 0.0, "5"]': "a number is needed, without quotes, got '5'",
    "angle_errors_deg = [-40.0, 40.0, 0.0]": "leave a gap of 200 deg",
    "relaxing = [0.6, 0.4]": "below 1 together",
    "relaxing = [-0.1, 0.1]": "from 0",
    "relaxation_times = [0.0, 20.0]": "times above 0 s",
    "couplin = 0.1": "did you mean coupling?",
}


@pytest.mark.parametrize(("line", "said"), INVALID.items())
def test_invalid_mismatch_is_rejected(line, said):
    arm = arm_to_toml(load_arm("twin_arm"))
    with pytest.raises(ArmError, match="fault") as caught:
        arm_from_toml(f"{arm}\n[modules.mismatch]\n{line}\n")
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("table", "line", "said"),
    [
        ("[modules.cable]", "travel = 0.02", "use tension_range"),
        ("[motor]", "homing_error = 0.001", "needs no homing"),
    ],
)
def test_a_tension_arm_rejects_displacement_parameters(table, line, said):
    with pytest.raises(ArmError, match=said):
        arm_from_toml(with_line("simulated_arm", table, line))


def test_cable_travel_is_independent_of_the_bend_limit(make_arm):
    plain, further = (
        ArmGeometry.of(make_arm(module={"cable": {"travel": way}}))
        for way in (None, 0.04)
    )
    assert np.abs(plain.action_high).max() == pytest.approx(0.027 * np.deg2rad(50.0))
    assert np.abs(further.action_high).max() == pytest.approx(0.04)
    np.testing.assert_array_equal(further.bend_limits, plain.bend_limits)
    straight_on = np.tile([1.0, 0.0], (3, 1))
    assert np.abs(further.actions_at(straight_on)).max() == pytest.approx(0.04)


def test_cable_travel_does_not_change_the_speed_of_commands(make_arm):
    steps = []
    for way in (None, 0.04):
        limits = CommandLimits.of(make_arm(module={"cable": {"travel": way}}))
        rest = limits.rest
        far = ArmGeometry.of(make_arm()).actions_at(np.tile([0.9, 0.0], (3, 1)))
        steps.append(limits.limited(far, rest, np.zeros_like(rest), far) - rest)
    assert np.abs(steps[0]).max() == pytest.approx(0.027 * np.deg2rad(4.0))
    np.testing.assert_allclose(*steps)
