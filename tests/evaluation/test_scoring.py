"""Scores of short artificial runs, with results computed by hand."""

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.episodes import Episode
from s2c2a.errors import S2C2AError
from s2c2a.evaluation import score_run
from s2c2a.goals import Goal
from s2c2a.spaces import Stage
from s2c2a.tasks import Score, Task

STEPS = 20
TWO = load_arm("twin_arm").model_copy(
    update={"modules": load_arm("twin_arm").modules[:2]}
)
REST = Goal.of(2)


def make_run(goals, states, scores, center_lines=None, period=0.1):
    """Episode with chosen states, and its task."""
    # the reading before the first action, then one after each action
    rows = np.concatenate([states[:1], states])
    columns = {
        "time": period * np.arange(len(rows)),
        "actions": np.zeros((len(rows), 2, 3)),
        "stage": np.array([Stage.RUN] * len(goals) + [Stage.IDLE], np.int8),
        "sensor.states": rows,
    }
    if center_lines is not None:
        columns["sensor.center_line"] = np.concatenate([center_lines[:1], center_lines])
    return Episode(TWO, columns), Task("artificial", tuple(goals), tuple(scores))


def states_at(tips, axes=(0, 0, 1)):
    """States of two modules: the lower end at 0.3 m, the tip as given."""
    states = np.zeros((len(tips), 2, 6))
    states[:, 0, 2] = 0.3
    states[:, :, 3:] = axes
    states[:, 1, :3] = tips
    return states


def off_by(errors):
    """Goals and states of a tip with some position errors [cm]."""
    tips = np.array([[error / 100, 0, 0.5] for error in errors])
    return [REST.with_position([0, 0, 0.5])] * len(tips), states_at(tips)


def score(run, recipe="paper"):
    (result,) = score_run(*run, recipe)
    return result


def value(goals, states, metric, recipe="paper", center_lines=None, **options):
    return score(
        make_run(goals, states, [Score(metric, **options)], center_lines), recipe
    ).value


def test_scores_come_in_the_order_of_the_task_with_values_for_every_step():
    scores = [Score("position"), Score("end distance"), Score("path length")]
    result = score_run(*make_run(*off_by(np.arange(STEPS)), scores), "paper")
    assert [scored.score for scored in result] == scores
    assert [scored.unit for scored in result] == ["cm", "cm", "cm"]
    assert [scored.values.shape for scored in result] == [(STEPS,)] * 3


def test_position_is_the_mean_distance_over_all_steps():
    result = score(make_run(*off_by([3, 1, 2, 6]), [Score("position")]))
    np.testing.assert_allclose(result.values, [3, 1, 2, 6], rtol=1e-6)
    assert result.value == pytest.approx(3.0)
    assert result.averaged


def test_steps_that_do_not_count_are_nan_and_not_in_the_mean():
    counting = Score("position", steps=np.array([False, True, True, False]))
    result = score(make_run(*off_by([3, 1, 2, 6]), [counting]))
    np.testing.assert_allclose(result.values, [np.nan, 1, 2, np.nan], rtol=1e-6)
    assert result.value == pytest.approx(1.5)


def test_the_mean_of_no_step_is_nan_without_a_warning():
    assert np.isnan(value(*off_by([3, 1]), "position", steps=np.zeros(2, bool)))


def test_constraint_is_the_position_error_of_the_chosen_module():
    goals = [REST.with_position([0, 0.04, 0.3], module=0).with_position([9, 9, 9])] * 3
    assert value(
        goals, states_at(np.zeros((3, 3))), "constraint", module=0
    ) == pytest.approx(4.0)


@pytest.mark.parametrize(
    ("metric", "expected"), [("tilt", 20.0), ("azimuth", 90.0), ("orientation", 90.0)]
)
def test_orientations_are_scored_against_the_desired_axis(metric, expected):
    """True axis along x; desired axis 70 deg from the vertical towards y."""
    desired = [0, np.sin(np.deg2rad(70)), np.cos(np.deg2rad(70))]
    states = states_at(np.zeros((2, 3)), axes=(1, 0, 0))
    assert value([REST.with_axis(desired)] * 2, states, metric) == pytest.approx(
        expected, abs=1e-4
    )


def test_orientation_is_scored_of_the_chosen_module():
    states = states_at(np.zeros((2, 3)))
    states[:, 0, 3:] = [0, 1, 0]
    goals = [REST.with_axis([0, 0, 1], module=0).with_axis([0, 0, 1])] * 2
    assert value(goals, states, "orientation", module=0) == pytest.approx(90)
    assert value(goals, states, "orientation") == pytest.approx(0)


def test_the_end_distance_is_the_mean_of_the_last_ten_steps():
    result = score(
        make_run(*off_by([50.0] * 10 + list(range(10))), [Score("end distance")])
    )
    assert result.value == pytest.approx(4.5)
    assert not result.averaged


@pytest.mark.parametrize(
    ("recipe", "miss", "reached"),
    [
        ("paper", 4.99, 1.0),
        ("paper", 5.01, 0.0),
        ("best", 2.99, 1.0),
        ("best", 3.01, 0.0),
        ("best", 4.99, 0.0),
    ],
)
def test_the_reach_threshold_is_5_cm_for_the_paper_recipe_and_3_cm_for_others(
    recipe, miss, reached
):
    assert value(*off_by([50] * 10 + [miss] * 10), "reached", recipe) == reached


def test_reaching_depends_on_the_mean_and_not_on_every_step():
    assert value(*off_by([50] * 10 + [9, 0] * 5), "reached") == 1.0
    assert value(*off_by([0] * 10 + [11, 0] * 5), "reached") == 0.0


OBSTACLE = REST.with_obstacles([[0.3, 0, 0.5]], [0.1])
TIPS = np.array([[0, 0, 0.5], [0.15, 0, 0.5], [0.1, 0, 0.5]])


def lines_to(tips, bulge):
    """Center lines of two moments and ten points; the first tip is off by `bulge`."""
    lines = np.zeros((len(tips), 2, 10, 3))
    lines[:, :, -1] = tips[:, None]
    lines[:, 0, -1, 0] += bulge
    return lines


def test_clearance_without_center_lines_is_the_smallest_at_control_steps():
    goals, states = [OBSTACLE] * 3, states_at(TIPS)
    result = score(make_run(goals, states, [Score("clearance")]))
    np.testing.assert_allclose(result.values, [20, 5, 10], atol=1e-5)
    assert result.value == pytest.approx(5.0, abs=1e-5)
    assert not result.averaged


@pytest.mark.parametrize(
    ("metric", "bulge", "middle", "expected"),
    [
        ("clearance", 0.07, 0.0, -2),
        ("clearance at steps", 0.07, 0.0, 5),
        ("clearance", 0.0, [0.3, 0, 0.45], 5),
        ("clearance of the arm", 0.0, [0.3, 0, 0.45], -5),
    ],
)
def test_clearance_is_of_all_moments_and_of_the_tip_unless_said_otherwise(
    metric, bulge, middle, expected
):
    lines = lines_to(TIPS, bulge)
    lines[:, :, 3] = middle
    found = value([OBSTACLE] * 3, states_at(TIPS), metric, center_lines=lines)
    assert found == pytest.approx(expected, abs=1e-5)


def test_clearance_of_the_arm_without_center_lines_uses_module_ends():
    """The lower end is 2 cm away from the obstacle, the tip further."""
    goals = [REST.with_obstacles([[0, 0.12, 0.3]], [0.1])] * 3
    assert value(goals, states_at(TIPS), "clearance of the arm") == pytest.approx(
        2, abs=1e-5
    )
    assert value(goals, states_at(TIPS), "clearance") > 10


def test_an_obstacle_counts_only_in_steps_with_that_obstacle():
    result = score(
        make_run(
            [REST, OBSTACLE, OBSTACLE], states_at(TIPS), [Score("clearance of the arm")]
        )
    )
    np.testing.assert_allclose(result.values, [np.inf, 5, 10], atol=1e-5)


def test_the_path_length_is_the_sum_of_the_steps():
    result = score(make_run([REST] * 3, states_at(TIPS), [Score("path length")]))
    np.testing.assert_allclose(result.values, [0, 15, 5], atol=1e-9)
    assert result.value == pytest.approx(20)


def test_stillness_is_the_largest_drift_of_the_tip_while_the_obstacle_is_far():
    tips = np.array(
        [[0, 0, 0.5], [0.006, 0, 0.5], [0.2, 0, 0.5], [0.002, 0, 0.5], [0.006, 0, 0.5]]
    )
    result = score(make_run([OBSTACLE] * 5, states_at(tips), [Score("stillness")]))
    np.testing.assert_allclose(result.values, [0, 0.6, np.nan, 0, 0.4], atol=1e-6)
    assert result.value == pytest.approx(0.6)


LATER = [True, False, False, True, True, True]


@pytest.mark.parametrize(
    ("errors", "reachable", "period", "expected"),
    [
        ([1, 9, 9, 9, 3.1, 2.9], LATER, 0.1, 0.2),
        ([1, 9, 9, 9, 3.1, 2.9], LATER, 0.05, 0.1),
        ([1, 9, 9, 2, 4, 1], LATER, 0.1, 0.2),
        ([9, 9, 9, 2.9, 2.9, 2.9], LATER, 0.1, 0.0),
        ([1, 9, 9, 9, 9, 1], [True, False, True, False, True, True], 0.1, 0.1),
        ([1, 9, 9, 9, 1, 3.1], LATER, 0.1, np.inf),
        ([9] * 6, [True] * 6, 0.1, np.nan),
        ([0] * 6, [False] * 6, 0.1, np.nan),
        ([0] * 6, [True] * 4 + [False] * 2, 0.1, np.nan),
        ([9] * 6, None, 0.1, np.nan),
    ],
)
def test_recovery_lasts_from_the_last_re_entry_until_the_error_stays_below_3_cm(
    errors, reachable, period, expected
):
    steps = None if reachable is None else np.array(reachable)
    scores = [Score("recovery", steps=steps)]
    result = score(make_run(*off_by(errors), scores, period=period))
    assert result.value == pytest.approx(expected, nan_ok=True)
    np.testing.assert_allclose(result.values, [np.nan] * 5 + [expected])
    assert not result.averaged


def test_the_return_to_rest_is_not_scored():
    """The tip is near its target while the arm runs or holds, and far afterwards."""
    goals, states = off_by([3, 1, 2, 6])
    episode, task = make_run(goals, states, [Score("position")])
    states_to_rest = np.concatenate(
        [episode["sensor.states"], states_at(np.full((3, 3), 9.0))]
    )
    stage = np.array(
        [Stage.RUN, Stage.HOLD, Stage.RUN, Stage.RUN, *[Stage.RELEASE] * 3, Stage.IDLE],
        np.int8,
    )
    longer = Episode(
        TWO,
        {
            "time": 0.1 * np.arange(8),
            "actions": np.zeros((8, 2, 3)),
            "stage": stage,
            "sensor.states": states_to_rest,
        },
    )
    assert score((longer, task)).value == pytest.approx(3.0)


def test_an_episode_without_true_states_or_of_another_length_is_not_score():
    goals, states = off_by([3, 1, 2, 6])
    episode, task = make_run(goals, states, [Score("position")])
    columns = dict(episode.columns)
    del columns["sensor.states"]
    without_states = Episode(TWO, columns)
    with pytest.raises(S2C2AError, match="no true states"):
        score_run(without_states, task, "paper")
    with pytest.raises(S2C2AError, match="has 4 steps; task 'artificial' has 3"):
        score_run(episode, Task("artificial", tuple(goals[:3])), "paper")
