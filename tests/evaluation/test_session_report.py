"""The warning that the seen tip disagrees with the model's stated deviation."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree

from made_up import TWIN, made_up
from s2c2a.arm.sensors import Camera, Sensors
from s2c2a.episodes import Episode
from s2c2a.estimation import EstimationSettings
from s2c2a.evaluation import (
    DisagreementWatch,
    describe_disagreement,
    describe_session,
)
from s2c2a.evaluation.lasting_error import module_ends
from s2c2a.jobs import Conditions
from s2c2a.kinematics import configurations_from_bends
from s2c2a.models.session import DayChange
from s2c2a.models.session_fit import DayPosterior, SessionFit
from s2c2a.robots import RobotFactory
from s2c2a.runtime import StepRecord
from s2c2a.spaces import Reading, Stage
from s2c2a.strategies import RunOptions

STEPS = 300
STD = 8e-3  # m, of a position in space


def still(rows: int) -> dict[str, np.ndarray]:
    """Columns of an arm that is where it was planned, within the data of its model."""
    straight = np.zeros((rows, 3, 3))
    straight[..., 2] = np.array([module.length for module in TWIN.modules])
    return {
        "sensed": straight,
        "planned": straight,
        "extrapolation": np.zeros(rows),
    }


def run(scale: float, shift: float = 0.0, seen: bool = True) -> Episode:
    """A run whose tip errs by `scale` stated deviations, and by a constant shift [m]."""
    random = np.random.default_rng(0)
    predicted = np.zeros((STEPS, 3, 6))
    states = np.full((STEPS, 3, 6), np.nan)
    noise = random.normal(scale=scale * STD / np.sqrt(3.0), size=(STEPS, 3))
    states[:, -1, :3] = noise + np.array([shift, 0.0, 0.0])
    std = np.full((STEPS, 3), STD)
    shown = {"sensor.states": states} if seen else {}
    return made_up(
        STEPS, predicted=predicted, predictive_std=std, **still(STEPS), **shown
    )


def test_errors_as_large_as_stated_are_no_disagreement():
    assert describe_disagreement(run(0.97)) == ""


@pytest.mark.parametrize(("scale", "shift"), [(1.5, 0.0), (0.9, 2.0 * STD)])
def test_larger_errors_and_a_lasting_shift_name_the_session(scale, shift):
    text = describe_disagreement(run(scale, shift))
    assert "which state 8.0 mm" in text
    assert "`s2c2a session`" in text


def test_insignificant_errors_are_no_disagreement_however_small_the_stated_ones():
    columns = dict(run(0.0, shift=4e-3).columns)
    columns["predictive_std"] = np.full((STEPS, 3), 3e-4)
    assert describe_disagreement(Episode(TWIN, columns)) == ""


def test_under_a_known_payload_no_session_is_advised():
    episode = run(1.5)
    assert describe_disagreement(episode.with_options(has_payload=False))
    assert describe_disagreement(episode.with_options(has_payload=True)) == ""


@pytest.mark.parametrize(
    ("simulated", "known", "has_payload"),
    [(0.0, 0.0, False), (0.2, 0.0, True), (0.0, 0.2, True)],
)
def test_a_payload_is_known_where_it_is_given(simulated, known, has_payload):
    robot = RobotFactory.simulation(payload=simulated)
    options = RunOptions(estimation=EstimationSettings(known))
    assert Conditions(robot, options).has_payload == has_payload
    typed = RobotFactory("sim", (("payload", str(simulated)),))
    assert Conditions(typed, options).has_payload == has_payload


def test_a_tip_that_was_not_seen_disagrees_with_nothing():
    assert describe_disagreement(run(9.0, seen=False)) == ""


def test_steps_in_which_the_arm_is_held_have_no_prediction_and_count_for_nothing():
    columns = dict(run(0.97).columns)
    for name in ("predicted", "predictive_std"):
        columns[name] = columns[name].copy()
        columns[name][100:110] = np.nan
    assert describe_disagreement(Episode(TWIN, columns)) == ""


@pytest.mark.parametrize(("bend", "moves_with_it"), [(0.005, True), (0.1, False)])
def test_an_arm_that_does_not_follow_its_plan_has_not_changed(bend, moves_with_it):
    columns = dict(run(0.97).columns)
    bent = configurations_from_bends(np.full((3, 2), bend, np.float32))
    columns["sensed"] = np.tile(np.asarray(bent), (STEPS, 1, 1))
    moved = module_ends(TWIN, columns["sensed"]) - module_ends(TWIN, columns["planned"])
    # near its plan, the tip is expected where the sensed arm is; else nowhere
    assert (np.linalg.norm(moved[0, -1]) < STD) == moves_with_it
    assert np.linalg.norm(moved[0, -1]) > 0.5 * STD
    states = columns["sensor.states"].copy()
    columns["sensor.states"] = states
    states[..., :3] += moved
    assert describe_disagreement(Episode(TWIN, columns)) == ""
    states[..., :3] -= 3.0 * moved
    told = describe_disagreement(Episode(TWIN, columns))
    assert ("`s2c2a session`" in told) == moves_with_it


def test_errors_where_the_model_has_no_data_are_no_change_of_the_arm():
    columns = dict(run(0.97, shift=2.0 * STD).columns)
    columns["extrapolation"] = np.full(STEPS, 0.9 * STD)
    assert describe_disagreement(Episode(TWIN, columns)) == ""


def test_a_motion_is_watched_while_it_goes_on():
    watch = DisagreementWatch(TWIN)
    states = np.zeros((3, 6))
    states[:, 5] = 1.0
    predicted = states.copy()
    predicted[-1, 0] = 5.0 * STD
    told = {name: values[0] for name, values in still(1).items()}
    told |= {"predicted": predicted, "predictive_std": np.full(3, STD)}
    texts = []
    for number in range(STEPS):
        reading = Reading(0.1 * number, {"states": states})
        step = StepRecord(
            number, 0.1 * number, Stage.RUN, reading, None, np.zeros((3, 3)), told
        )
        watch.add([step])
        texts.append(watch.text)
    assert set(texts[:-1]) == {""}
    assert "the tip was 40.0 mm from its predictions" in texts[-1]
    assert "if nothing hangs at the arm or pushes it" in texts[-1]


@pytest.mark.parametrize("states_age", [True, False])
def test_a_late_picture_of_a_moving_tip_is_compared_with_the_time_that_it_shows(
    states_age,
):
    late = 3  # rows
    camera = Camera(delay=0.3)
    arm = TWIN.model_copy(update={"sensors": Sensors(camera=camera)})
    rows = np.arange(STEPS)
    predicted = np.zeros((STEPS, 3, 6))
    predicted[:, -1, 0] = 0.02 * (rows + 1)  # m; of the next row
    pictures = np.full((STEPS, 3, 3), np.nan)
    pictures[:, -1] = 0.0
    pictures[:, -1, 0] = 0.02 * (rows - late)
    columns = {
        "predicted": predicted,
        "predictive_std": np.full((STEPS, 3), STD),
        "sensor.camera_positions": pictures,
        **still(STEPS),
    }
    if states_age:
        columns["sensor.camera_age"] = np.full(STEPS, 0.1 * late)
    assert describe_disagreement(made_up(STEPS, arm, **columns)) == ""
    columns["sensor.camera_positions"] = pictures + 2.0 * STD
    assert "`s2c2a session`" in describe_disagreement(made_up(STEPS, arm, **columns))


@pytest.mark.parametrize(
    ("turn", "said"),
    [
        ((0.9, 0.0, 0.0), "not distinguishable from none"),
        ((0.9, 0.3, 0.0), "frame of the tracking: changed"),  # but not by 0.9 deg
        ((2.4, 0.3, 0.0), "frame of the tracking: 2.4 ± 0.7 deg of turn"),
    ],
)
def test_a_session_lists_sizes_beyond_two_deviations_alone(turn, said):
    none = DayChange.none(TWIN.module_count)
    change = replace(none, rotation=jnp.deg2rad(jnp.asarray(turn)))
    std = np.full(len(ravel_pytree(change)[0]), 1e-3)
    std[3:6] = np.deg2rad([0.7, 0.05, 0.7])
    posterior = DayPosterior(change, np.diag(std**2))
    fit = SessionFit(posterior, change, before=0.01, after=0.002, improves=True)
    report = " ".join(describe_session(fit, TWIN))
    assert said in report
    assert ("deg of turn" in report) == ("deg of turn" in said)
