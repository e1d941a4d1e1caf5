"""Randomized arms: size of the mismatch, and its effect on the simulation only."""

import numpy as np
import pytest

from s2c2a.arm import ArmGeometry, arm_to_toml, load_arm, randomized_arm
from s2c2a.arm.geometry import per_cable, per_module
from s2c2a.cli.main import main
from s2c2a.errors import ArmError
from s2c2a.robots.simulation.modes import first_mode

TWIN = load_arm("twin_arm")
DRAWN = 40


def values(key: str, strength: float) -> np.ndarray:
    """Of a key of `mismatch`, in all modules of many arms."""
    arms = [randomized_arm(TWIN, seed, strength) for seed in range(DRAWN)]
    return np.array([per_module(arm, f"mismatch.{key}") for arm in arms])


@pytest.mark.parametrize("strength", [0.5, 1.0])
@pytest.mark.parametrize(
    ("key", "low", "high"),
    [
        ("angle_errors_deg", -5.0, 5.0),
        ("radius_errors", -0.06, 0.06),
        ("mass_error", -0.1, 0.1),
        ("stiffness_error", -0.1, 0.1),
        ("relaxing", 0.1, 1 / 7),
        ("rest_bend_deg", 2.0, 4.0),
    ],
)
def test_mismatch_fills_its_range_in_proportion_to_the_strength(
    key, low, high, strength
):
    drawn = values(key, strength) / strength
    margin = 0.1 * (high - low)
    assert low * (1 + 1e-3 * np.sign(-low)) <= drawn.min() <= low + margin
    assert high - margin <= drawn.max() <= high * (1 + 1e-3)


def test_fixed_parameters_have_their_value():
    arm = randomized_arm(TWIN, 2, 1.0)
    fixed = {"coupling": 0.25, "stiffness_ratio": 1.15, "hardening": 0.2}
    for key, value in fixed.items():
        np.testing.assert_array_equal(per_module(arm, f"mismatch.{key}"), value)
    np.testing.assert_array_equal(np.abs(per_module(arm, "mismatch.drift")), 0.05)
    np.testing.assert_array_equal(per_module(arm, "cable.friction"), 0.1)
    assert per_module(arm, "cable.viscous_friction").min() > 0
    assert arm.motor.homing_error == pytest.approx(3e-4)
    times = per_module(arm, "mismatch.relaxation_times")
    np.testing.assert_array_equal(times, [[2.0, 20.0]] * 3)


def test_backlash_differs_between_cables_and_replaces_the_bases_with_the_strength():
    half, whole = (
        per_cable(randomized_arm(TWIN, 4, strength), "cable.backlash")
        for strength in (0.5, 1.0)
    )
    assert whole.min() >= 0.2e-3
    assert whole.max() <= 1.0e-3
    assert len(np.unique(whole)) == whole.size
    mean = 0.5 * (whole + per_cable(TWIN, "cable.backlash"))
    np.testing.assert_allclose(half, mean, rtol=1e-3)


def test_modules_shorten_by_two_to_four_per_cent_with_all_of_them_at_full_bend():
    """Expected tension: one cable a module, also through proximal modules."""
    shares = []
    for seed in range(DRAWN):
        arm = randomized_arm(TWIN, seed, 1.0)
        pulls = np.array([3, 2, 1]) * 0.125 * np.deg2rad(47.0) / 0.2 / 0.027
        shares.append(pulls / per_module(arm, "mismatch.axial_stiffness"))
    assert np.min(shares) == pytest.approx(0.02, abs=0.001)
    assert np.max(shares) == pytest.approx(0.04, abs=0.001)


def test_nominal_geometry_does_not_contain_the_mismatch():
    drawn = ArmGeometry.of(randomized_arm(TWIN, 6, 1.0))
    for name, value in vars(ArmGeometry.of(TWIN)).items():
        np.testing.assert_array_equal(value, getattr(drawn, name))


def test_the_arm_depends_on_the_seed_only():
    assert randomized_arm(TWIN, 8, 0.7) == randomized_arm(TWIN, 8, 0.7)
    assert randomized_arm(TWIN, 8, 0.7).differences(randomized_arm(TWIN, 9, 0.7))


@pytest.mark.parametrize(
    ("seed", "strength"), [(-1, 1.0), (0, -0.1), (0, 2.1), (0, float("nan"))]
)
def test_invalid_seeds_and_strengths_are_rejected(seed, strength):
    with pytest.raises(ArmError, match="strength"):
        randomized_arm(TWIN, seed, strength)


@pytest.mark.parametrize("base", ["twin_arm", "simulated_arm", "twin_both"])
@pytest.mark.parametrize("seed", range(3))
def test_randomized_arms_are_stable(base, seed):
    frequency, _ = first_mode(randomized_arm(load_arm(base), seed, 1.0))
    assert frequency > 0.2


def test_the_command_writes_the_sampled_arm(tmp_path, capsys):
    command = ["arm", "random", "--seed", "3", "--strength", "0.5", "--out"]
    main([*command, str(tmp_path / "drawn.toml")])
    written = (tmp_path / "drawn.toml").read_text()
    assert written == arm_to_toml(randomized_arm(TWIN, 3, 0.5))
    assert "drawn.toml" in capsys.readouterr().out
