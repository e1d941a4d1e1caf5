"""The simulated arm fitted to recordings: numbers found back, what is not seen, and files."""

from dataclasses import replace

import numpy as np
import pytest

from s2c2a.arm import ArmGeometry, arm_from_toml
from s2c2a.data import Recording, episode_actions
from s2c2a.episodes import Episode
from s2c2a.errors import RecordingError, S2C2AError
from s2c2a.identification import (
    FitOptions,
    Replay,
    arm_at,
    errors_of,
    fitted_toml,
    found_numbers,
    held_out,
    identify,
    options_for,
    replayed,
    stated_for,
    thinned,
    unknowns_of,
    untold,
)

ROWS, NOISE = 130, 0.0005  # m
GROUPS = ("stiffness", "routing", "backlash")


def recorded(arm, rows=ROWS, seed=0, how=None, moved=True) -> Episode:
    """What an arm's tip did while it babbled, seen with noise; nothing else is seen of it."""
    actions = episode_actions(ArmGeometry.of(arm), "motor", 0, 1, rows, seed) * moved
    columns = {"time": np.arange(rows) / arm.control_rate, "actions": actions}
    unseen = Episode(arm, columns | {"sensor.cables": np.zeros_like(actions)})
    states = replayed(arm, [unseen], how or Replay())[0]
    states[:, -1, :3] += np.random.default_rng(seed).normal(scale=NOISE, size=(rows, 3))
    states[:, :-1], states[:, -1, 3:] = np.nan, np.nan
    return Episode(arm, {**unseen.columns, "sensor.states": states})


@pytest.fixture(scope="module")
def start(make_arm):
    """Two modules, as they are described."""
    return make_arm(
        modules=2, module={"cable": {"stiffness": 4000.0, "backlash": 0.0005}}
    )


@pytest.fixture(scope="module")
def truth(start):
    """Coordinates of an arm that was drawn from what one believes of the described one."""
    unknowns = unknowns_of(start, GROUPS)
    return np.random.default_rng(6).uniform(-0.9, 0.9, size=len(unknowns))


@pytest.fixture(scope="module")
def fit(start, truth):
    """The described arm fitted to what the drawn one did."""
    unknowns = unknowns_of(start, GROUPS)
    return identify(
        start,
        unknowns,
        [recorded(arm_at(start, unknowns, truth))],
        FitOptions(rounds=8),
    )


def test_stiffness_play_and_routing_of_a_drawn_arm_are_found_within_their_errors(
    fit, truth
):
    off = (fit.coordinates - truth) / fit.belief.std
    assert np.abs(off).max() < 3
    assert np.sqrt(np.mean(off**2)) < 1.5


def test_most_numbers_are_known_far_better_than_before(fit):
    assert np.median(fit.belief.std) < 0.2


def test_the_twin_errs_by_little_more_than_the_noise_where_it_was_not_fitted(fit):
    errors = errors_of(fit, {"another": [recorded(fit.arm, 60, seed=3)]})
    assert errors["held-out rows"].rms < 2.5 * NOISE
    assert errors["another"].rms < 2.5 * NOISE


def test_the_fitted_file_is_that_arm_with_an_uncertainty_beside_each_number(fit):
    text = fitted_toml(fit, "a remark")
    assert arm_from_toml(text) == fit.arm
    assert text.startswith("# a remark\n")
    said = [line for line in text.splitlines()[2:] if "  # " in line]
    # length, angles, radius, stiffness, backlash of each cable
    assert len(said) == 2 * (1 + 3 + 1 + 1 + 3)
    assert all("+-" in line and "was" in line for line in said)


def test_found_numbers_are_those_of_the_file(fit):
    found = {one.name: one.value for one in found_numbers(fit)}
    assert found["modules.1.cable_radius"] == fit.arm.modules[1].cable_radius
    assert (
        found["modules.0.cable_angles_deg.2"] == fit.arm.modules[0].cable_angles_deg[2]
    )


def test_weight_and_stiffness_that_only_show_together_are_named(make_arm):
    """A tip that rests under its weight alone tells their ratio, not their size."""
    arm = make_arm(
        modules=1,
        actuation="tension",
        module={"tension_range": 5.0},
        gravity_direction=(1.0, 0.0, 0.0),
    )
    how = Replay(settling=2.0)
    seen = recorded(arm, 8, how=how, moved=False)
    unknowns = unknowns_of(arm, ("stiffness", "mass"), moving=False)
    said = untold(identify(arm, unknowns, [seen], FitOptions(how, rounds=2)).belief)
    assert len(said) == 1
    assert "modules.0.bending_stiffness" in said[0]
    assert "+ 0." in said[0] or "- 0." in said[0]


def test_a_frame_that_is_off_is_found_and_told(start):
    seen = recorded(start, 60)
    shifted = np.array(seen["sensor.states"])
    shifted[..., :3] += (0.01, 0.0, -0.02)
    moved = replace(seen, columns={**seen.columns, "sensor.states": shifted})
    fit = identify(
        start,
        unknowns_of(start, ("stiffness",)),
        [moved],
        FitOptions(frame=True, rounds=4),
    )
    found = {one.name: one.value for one in found_numbers(fit)}
    assert found["frame.shift_x"] == pytest.approx(0.01, abs=0.002)
    assert found["frame.shift_z"] == pytest.approx(-0.02, abs=0.002)
    assert errors_of(fit, {})["fitted rows"].rms < 2 * NOISE


def test_directions_have_no_seam(make_arm):
    arm = make_arm(
        modules=1,
        module={"mismatch": {"rest_bend_deg": 3.0, "rest_azimuth_deg": 180.0}},
    )
    unknowns = unknowns_of(arm, ("rest",))
    mismatch = arm_at(arm, unknowns, np.array([0.0, -0.1])).modules[0].mismatch
    assert [one.start for one in unknowns] == pytest.approx([-3.0, 0.0], abs=1e-12)
    assert mismatch.rest_bend_deg == pytest.approx(np.hypot(3, 0.5))
    assert mismatch.rest_azimuth_deg == pytest.approx(
        -180 + np.rad2deg(np.arctan2(0.5, 3))
    )


def test_at_zero_coordinates_an_arm_is_what_its_file_says(twin):
    unknowns = unknowns_of(twin)
    assert arm_at(twin, unknowns, np.zeros(len(unknowns))) == twin


def test_a_body_that_hardly_shortens_is_the_start_where_shortening_is_fitted(twin):
    assert stated_for(twin, ("stiffness",)) == twin
    stated = stated_for(twin, ("shortening",))
    assert stated.modules[0].mismatch.axial_stiffness == pytest.approx(
        20 * 0.125 / 0.027**2
    )
    assert len(unknowns_of(stated, ("shortening",))) == 3
    assert stated_for(stated, ("shortening",)) == stated


def test_every_fifth_stretch_of_25_rows_and_every_beginning_is_kept_from_the_fit(start):
    kept = held_out([recorded(start, 140), recorded(start, 120)])
    turns = [
        list(np.flatnonzero(np.diff(rows.astype(int), prepend=0))) for rows in kept
    ]
    assert turns == [[0, 1, 100, 125], [0, 1, 85, 110]]


def test_shapes_at_rest_are_thinned_with_the_actions_that_lead_to_them(start):
    episode = recorded(start, 30)
    fewer = thinned([episode], 10)[0]
    np.testing.assert_array_equal(fewer["time"], episode["time"][::3])
    np.testing.assert_array_equal(fewer["actions"][:-1], episode["actions"][2:-1:3])


def test_what_was_really_sent_is_replayed_beyond_the_limits_of_the_start(start):
    seen = recorded(start, 30)
    narrow = start.model_copy(
        update={
            "modules": tuple(
                m.model_copy(update={"bend_limit_deg": 5.0}) for m in start.modules
            )
        }
    )
    np.testing.assert_allclose(
        replayed(narrow, [seen], Replay())[0], replayed(start, [seen], Replay())[0]
    )


@pytest.mark.parametrize(
    ("said", "imported"), [("imported log", True), ("staged", False)]
)
def test_of_an_imported_recording_the_frame_is_fitted_and_episodes_follow_each_other(
    start, said, imported
):
    options = options_for(
        Recording(start, {"babbling": said}, (recorded(start, 5),)), 0.1, 3, "fast"
    )
    assert options == FitOptions(Replay(0.1, imported, "fast"), imported, 3)


def test_nothing_seen_and_nothing_to_fit_are_refused(start):
    seen = recorded(start, 30)
    blind = replace(
        seen, columns={**seen.columns, "sensor.states": np.full((30, 2, 6), np.nan)}
    )
    with pytest.raises(RecordingError, match="no measured states"):
        identify(start, unknowns_of(start, GROUPS), [blind])
    with pytest.raises(S2C2AError, match="choose from stiffness"):
        unknowns_of(start, ("color",))
    with pytest.raises(S2C2AError, match="can show"):
        unknowns_of(start, ("damping",), moving=False)
