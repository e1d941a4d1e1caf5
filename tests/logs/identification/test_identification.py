"""Fit of a simulated arm to recordings: accuracy, identifiability, and files."""

from dataclasses import replace

import numpy as np
import pytest

from s2c2a.arm import ArmGeometry, Cable, arm_from_toml, load_arm
from s2c2a.data import Recording, episode_actions
from s2c2a.episodes import Episode
from s2c2a.errors import RecordingError, S2C2AError
from s2c2a.logs.identification import (
    IdentificationOptions,
    Replay,
    arm_at,
    errors_of,
    fitted_numbers,
    fitted_toml,
    held_out,
    identify,
    options_for,
    replayed,
    thinned,
    undetermined_combinations,
    unknowns_of,
    with_default_starts,
)

ROWS = 130
NOISE = 0.0005  # m
GROUPS = ("stiffness", "routing", "backlash")


def recorded(arm, rows=ROWS, seed=0, how=None, moved=True) -> Episode:
    """Babbling of an arm, with noisy positions of the tip alone."""
    actions = episode_actions(ArmGeometry.of(arm), "motor", 0, 1, rows, seed) * moved
    columns = {"time": np.arange(rows) / arm.control_rate, "actions": actions}
    unseen = Episode(arm, columns | {"sensor.cables": np.zeros_like(actions)})
    states = replayed(arm, [unseen], how or Replay())[0]
    states[:, -1, :3] += np.random.default_rng(seed).normal(scale=NOISE, size=(rows, 3))
    states[:, :-1] = np.nan
    states[:, -1, 3:] = np.nan
    return Episode(arm, {**unseen.columns, "sensor.states": states})


@pytest.fixture(scope="module")
def start(make_arm):
    """Described arm of two modules."""
    cable = {"stiffness": 4000.0, "backlash": 0.0005}
    return make_arm(modules=2, module={"cable": cable})


@pytest.fixture(scope="module")
def truth(start):
    """Coordinates of a randomized arm within the prior."""
    unknowns = unknowns_of(start, GROUPS)
    return np.random.default_rng(6).uniform(-0.9, 0.9, size=len(unknowns))


@pytest.fixture(scope="module")
def fit(start, truth):
    """Described arm fitted to a recording of the randomized one."""
    unknowns = unknowns_of(start, GROUPS)
    seen = recorded(arm_at(start, unknowns, truth))
    return identify(start, unknowns, [seen], IdentificationOptions(rounds=4))


@pytest.mark.slow
def test_stiffness_backlash_and_routing_are_identified_within_their_uncertainty(
    fit, truth
):
    off = (fit.coordinates - truth) / fit.posterior.std
    assert np.abs(off).max() < 3
    assert np.sqrt(np.mean(off**2)) < 1.5
    assert np.median(fit.posterior.std) < 0.2


@pytest.mark.slow
def test_the_error_on_held_out_rows_is_close_to_the_noise(fit):
    errors = errors_of(fit, {"another": [recorded(fit.arm, 60, seed=3)]})
    assert errors["held-out rows"].rms < 2.5 * NOISE
    assert errors["another"].rms < 2.5 * NOISE


@pytest.mark.slow
def test_the_fitted_file_has_an_uncertainty_for_each_number(fit):
    text = fitted_toml(fit, "a remark")
    assert arm_from_toml(text) == fit.arm
    assert text.startswith("# a remark\n")
    commented = [line for line in text.splitlines()[2:] if line.startswith("# ")]
    # length, angles, radius, stiffness, backlash of each cable
    assert len(commented) == 2 * (1 + 3 + 1 + 1 + 3)
    assert [line[2:].split(":")[0] for line in commented] == [
        number.name for number in fitted_numbers(fit)[: len(commented)]
    ]
    assert all("+-" in line and "was" in line for line in commented)
    found = {one.name: one.value for one in fitted_numbers(fit)}
    first, second = fit.arm.modules
    assert found["modules.1.cable_radius"] == second.cable_radius
    assert found["modules.0.cable_angles_deg.2"] == first.cable_angles_deg[2]


@pytest.fixture
def level(make_arm):
    """A module that gravity bends, with cables that are pulled by forces."""
    return make_arm(
        modules=1,
        actuation="tension",
        module={"tension_range": 5.0},
        gravity_direction=(1.0, 0.0, 0.0),
    )


def test_mass_and_stiffness_without_separate_effects_are_reported(level):
    """Rest under gravity alone determines their ratio, not their size."""
    how = Replay(settling=2.0)
    seen = recorded(level, 8, how=how, moved=False)
    unknowns = unknowns_of(level, ("stiffness", "mass"), moving=False)
    fit = identify(level, unknowns, [seen], IdentificationOptions(how, rounds=2))
    (text,) = undetermined_combinations(fit.posterior)
    assert "modules.0.bending_stiffness" in text
    assert "+ 0." in text or "- 0." in text


def test_a_mass_at_the_tip_is_identified_from_rest_under_gravity(level):
    how = Replay(settling=2.0)
    unknowns = unknowns_of(level, ("tip",), moving=False)
    loaded = arm_at(level, unknowns, [1.0])
    seen = recorded(loaded, 8, how=how, moved=False)
    fit = identify(level, unknowns, [seen], IdentificationOptions(how, rounds=3))
    assert loaded.tip.mass == pytest.approx(0.05)
    assert fit.arm.tip.mass == pytest.approx(0.05, abs=0.005)
    assert "[tip]" in fitted_toml(fit)


@pytest.mark.slow
def test_a_shifted_frame_is_identified_and_reported(start):
    seen = recorded(start, 60)
    shifted = np.array(seen["sensor.states"])
    shifted[..., :3] += (0.01, 0.0, -0.02)
    moved = replace(seen, columns={**seen.columns, "sensor.states": shifted})
    options = IdentificationOptions(frame=True, rounds=4)
    fit = identify(start, unknowns_of(start, ("stiffness",)), [moved], options)
    found = {one.name: one.value for one in fitted_numbers(fit)}
    assert found["frame.shift_x"] == pytest.approx(0.01, abs=0.002)
    assert found["frame.shift_z"] == pytest.approx(-0.02, abs=0.002)
    assert errors_of(fit, {})["fitted rows"].rms < 2 * NOISE


def test_directions_are_continuous_across_a_turn(make_arm):
    rest = {"rest_bend_deg": 3.0, "rest_azimuth_deg": 180.0}
    arm = make_arm(modules=1, module={"mismatch": rest})
    unknowns = unknowns_of(arm, ("rest",))
    mismatch = arm_at(arm, unknowns, np.array([0.0, -0.1])).modules[0].mismatch
    assert [one.start for one in unknowns] == pytest.approx([-3.0, 0.0], abs=1e-12)
    assert mismatch.rest_bend_deg == pytest.approx(np.hypot(3, 0.5))
    azimuth = np.rad2deg(np.arctan2(0.5, 3)) - 180
    assert mismatch.rest_azimuth_deg == pytest.approx(azimuth)


def test_an_arm_at_zero_coordinates_equals_its_file(twin):
    unknowns = unknowns_of(twin)
    assert arm_at(twin, unknowns, np.zeros(len(unknowns))) == twin


def test_the_fit_of_shortening_starts_at_an_arm_that_hardly_shortens(twin):
    assert with_default_starts(twin, ("stiffness",)) == twin
    stated = with_default_starts(twin, ("shortening",))
    stiffness = stated.modules[0].mismatch.axial_stiffness
    assert stiffness == pytest.approx(20 * 0.125 / 0.027**2)
    assert len(unknowns_of(stated, ("shortening",))) == 3
    assert with_default_starts(stated, ("shortening",)) == stated


def test_the_fit_of_cables_starts_where_they_yield_unless_their_stiffness_is_stated(
    twin,
):
    assert with_default_starts(twin, ("cables",)) == twin
    modules = tuple(
        module.model_copy(update={"cable": Cable()}) for module in twin.modules
    )
    silent = twin.model_copy(update={"modules": modules})
    assert with_default_starts(silent, ("shortening",)).modules[0].cable == Cable()
    first = with_default_starts(silent, ("cables",)).modules[0]
    bend = first.cable.stiffness * first.cable_radius**2 * first.length
    assert bend / first.bending_stiffness == pytest.approx(4.0)


@pytest.mark.parametrize("name", ["pneumatic_arm", "simulated_arm"])
def test_a_number_that_no_fit_shows_keeps_the_value_of_the_file(name):
    arm = load_arm(name)
    assert arm.actuation != "displacement"
    assert with_default_starts(arm, ("cables",)) == arm


def test_every_fifth_block_of_25_rows_and_first_rows_are_held_out(start):
    kept = held_out([recorded(start, 140), recorded(start, 120)])
    turns = [np.flatnonzero(np.diff(rows, prepend=False)).tolist() for rows in kept]
    assert turns == [[0, 1, 100, 125], [0, 1, 85, 110]]


def test_poses_at_rest_are_thinned_with_the_actions_that_lead_to_them(start):
    episode = recorded(start, 30)
    fewer = thinned([episode], 10)[0]
    np.testing.assert_array_equal(fewer["time"], episode["time"][::3])
    np.testing.assert_array_equal(fewer["actions"][:-1], episode["actions"][2:-1:3])


def test_recorded_actions_beyond_the_limits_of_the_start_are_replayed(start):
    seen = recorded(start, 30)
    modules = [one.model_copy(update={"bend_limit_deg": 5.0}) for one in start.modules]
    narrow = start.model_copy(update={"modules": tuple(modules)})
    found, expected = (replayed(arm, [seen], Replay()) for arm in (narrow, start))
    np.testing.assert_allclose(found[0], expected[0])


@pytest.mark.parametrize(
    ("babbling", "imported"), [("imported log", True), ("staged", False)]
)
def test_the_frame_of_an_imported_recording_is_fitted_and_its_episodes_are_continuous(
    start, babbling, imported
):
    recording = Recording(start, {"babbling": babbling}, (recorded(start, 5),))
    options = options_for(recording, 0.1, 3, "fast")
    assert options == IdentificationOptions(Replay(0.1, imported, "fast"), imported, 3)


def test_recordings_without_states_and_groups_without_numbers_are_refused(start):
    seen = recorded(start, 30)
    unknown = {"sensor.states": np.full((30, 2, 6), np.nan)}
    blind = replace(seen, columns=seen.columns | unknown)
    with pytest.raises(RecordingError, match="no measured states"):
        identify(start, unknowns_of(start, GROUPS), [blind])
    with pytest.raises(S2C2AError, match="choose from stiffness"):
        unknowns_of(start, ("color",))
    with pytest.raises(S2C2AError, match="can show"):
        unknowns_of(start, ("damping",), moving=False)
