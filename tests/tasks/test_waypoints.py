"""A user's own path from a table, and what is refused of it."""

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.errors import TargetError
from s2c2a.tasks import (
    Score,
    Waypoints,
    load_task,
    load_waypoints,
    unreachable_waypoints,
    waypoints_task,
)

TWIN = load_arm("twin_arm")
SLOPE = "time,x,y,z\n0,0,0,0.6\n1,0.1,0,0.58\n3,0.1,0.2,0.54\n"
POINTED = "time,x,y,z,axis_x,axis_y,axis_z\n0,0,0,0.6,0,0,2\n2,0.2,0,0.55,3,0,4\n"
TWO = "time,x,y,z,module\n0,0,0,0.2,0\n0,0,0,0.6,2\n1,0.02,0,0.19,0\n2,0.1,0,0.58,2\n"


@pytest.fixture
def table(tmp_path):
    """Writes a file of waypoints."""

    def write(text, encoding="utf-8"):
        path = tmp_path / "my_path.csv"
        path.write_text(text, encoding=encoding)
        return path

    return write


def tip_path(tracks, arm=TWIN):
    return waypoints_task("mine", tracks, arm).desired_positions()[:, -1]


def test_axes_of_any_length_become_directions(table):
    (track,) = load_waypoints(table(POINTED))
    np.testing.assert_allclose(track.axes, [[0, 0, 1], [0.6, 0, 0.8]])


def test_every_module_named_has_a_track_of_its_own(table):
    base, tip = load_waypoints(table(TWO))
    assert (base.module, tip.module) == (0, 2)
    np.testing.assert_array_equal(base.times, [0, 1])
    np.testing.assert_array_equal(tip.positions, [[0, 0, 0.6], [0.1, 0, 0.58]])


WRITTEN = {
    "plain": SLOPE,
    "windows": SLOPE.replace("\n", "\r\n"),
    "spaces": SLOPE.replace(",", ", "),
    "wide": SLOPE.replace(",", " , "),
    "edges": " " + SLOPE.replace("\n", " \n"),
    "blank lines": SLOPE.replace("\n", "\n\n"),
    "no last end": SLOPE.rstrip("\n"),
    "quotes": SLOPE.replace("0.6", '"0.6"').replace("0.1", "1e-1"),
    "other order": "y,z,time,x\n0,0.6,0,0\n0,0.58,1,0.1\n0.2,0.54,3,0.1\n",
    "byte order mark": "\ufeff" + SLOPE,
    "semicolons": SLOPE.replace(",", ";").replace(".", ","),
    "tabs": SLOPE.replace(",", "\t"),
    "capitals": SLOPE.replace("time,x,y,z", "Time,X,Y,Z"),
    "units": "time [s],x [mm],y (mm),z [cm]\n0,0,0,60\n1,100,0,58\n3,100,200,54\n",
    "aligned": "\ufefftime x  y z\n0 0 0 0.6\n1 0.1 0 0.58\n3 0.1 0.2 0.54\n",
    "comments": "# a path\n# time x y z\n0 0 0 0.6\n1 0.1 0 0.58\n3 0.1 0.2 0.54\n",
}


@pytest.mark.parametrize("text", WRITTEN.values(), ids=WRITTEN)
def test_tables_as_programs_write_them_are_the_same_track_of_the_tip(table, text):
    (track,) = load_waypoints(table(text))
    assert (track.module, track.axes) == (-1, None)
    np.testing.assert_array_equal(track.times, [0, 1, 3])
    expected = [[0, 0, 0.6], [0.1, 0, 0.58], [0.1, 0.2, 0.54]]
    np.testing.assert_array_equal(track.positions, expected)


def test_between_waypoints_the_target_goes_straight_at_the_arms_rate(table):
    path = tip_path(load_waypoints(table(SLOPE)))
    assert len(path) == 30
    way = [[0.01, 0, 0.598], [0.05, 0, 0.59], [0.1, 0, 0.58]]
    np.testing.assert_allclose(path[[0, 4, 9]], way, atol=1e-7)
    way = [[0.1, 0.1, 0.56], [0.1, 0.2, 0.54]]
    np.testing.assert_allclose(path[[19, 29]], way, atol=1e-7)


def test_the_first_waypoint_holds_before_it_and_the_last_after_it(table):
    tip = "1,0.1,0,0.58,-1\n2,0.2,0,0.55,-1\n"
    late = table(f"time,x,y,z,module\n{tip}0,0,0,0.2,0\n1,0.02,0,0.19,0\n")
    desired = waypoints_task("late", load_waypoints(late), TWIN).desired_positions()
    np.testing.assert_allclose(desired[:10, 2], [[0.1, 0, 0.58]] * 10, atol=1e-7)
    np.testing.assert_allclose(desired[9:, 0], [[0.02, 0, 0.19]] * 11, atol=1e-7)


def test_a_last_time_between_two_steps_ends_with_the_step_before(table):
    tracks = load_waypoints(table("time,x,y,z\n0,0,0,0.6\n0.57,0.1,0,0.58\n"))
    assert len(tip_path(tracks)) == 5


def test_axes_turn_from_one_waypoint_to_the_next(table):
    """Half-way between (0, 0, 1) and (0.6, 0, 0.8)."""
    task = waypoints_task("mine", load_waypoints(table(POINTED)), TWIN)
    axes = task.desired_axes()[:, -1]
    np.testing.assert_allclose(axes[9], np.array([0.3, 0, 0.9]) / 0.9**0.5, atol=1e-6)
    np.testing.assert_allclose(axes[19], [0.6, 0, 0.8], atol=1e-6)


def test_positions_count_once_axes_twice_and_change_half(table):
    goals = waypoints_task("mine", load_waypoints(table(POINTED)), TWIN).goals
    assert {tuple(goal.position_weights) for goal in goals} == {(0, 0, 1)}
    assert {tuple(goal.axis_weights) for goal in goals} == {(0, 0, 2)}
    assert {float(goal.change_weight) for goal in goals} == {0.5}


def test_every_track_is_scored_by_its_targets(table):
    pointed = waypoints_task("mine", load_waypoints(table(POINTED)), TWIN)
    assert pointed.scores == (Score("position"), Score("orientation"))
    two = waypoints_task("mine", load_waypoints(table(TWO)), TWIN)
    assert two.scores == (Score("position", 0), Score("position", 2))


def test_a_file_is_a_task_by_its_name(table):
    task = load_task(str(table(SLOPE)), TWIN)
    assert (task.name, len(task.goals)) == ("my_path", 30)


def test_a_missing_file_is_reported_with_the_columns(tmp_path):
    told = r"no waypoints at .*nowhere\.csv; .*time, x, y, z"
    with pytest.raises(TargetError, match=told):
        load_waypoints(tmp_path / "nowhere.csv")
    with pytest.raises(TargetError, match="no waypoints at"):
        load_waypoints(tmp_path)


@pytest.mark.parametrize(
    "columns",
    [
        "time,x,y",
        "x,y,z",
        "time,x,y,z,speed",
        "time,x,y,z,axis_x",
        "time,x,x,y,z",
        "time,x,y,z,axis_x,axis_y",
        "time,x,y,z,",
        "0,0,0,0.6",
        "",
    ],
)
def test_other_columns_are_rejected_with_the_valid_ones(table, columns):
    told = r"has the columns .*it needs time, x, y, z, and may have axis_x"
    with pytest.raises(TargetError, match=told):
        load_waypoints(table(columns + "\n0,0,0,0.6\n1,0,0,0.6\n"))


HEAD, FIRST = "time,x,y,z\n", "0,0,0,0.6\n"
EMPTY = "holds no waypoints; give at least one line"
NO_NUMBER = r"my_path\.csv, line 3: every column must hold one number"
NOT_FINITE = "line 3: numbers must be finite"
NOT_WHOLE = "line 2: numbers must be finite, and the module a whole number"
RISING = "times of a module must rise, got "
WORDS = ("1,0.1,here,0.5", "1,0.1,,0.5", "1,0.1,0.5", "1,0.1,0.2,0.5,7", "1,0.1,0x2,0")
ENDLESS = ("1,nan,0,0.5", "1,0,inf,0.5", "nan,0,0,0.5", "1,0,0,-inf", "1,0,0,1e999")
REFUSED = [
    ("", "has the columns none"),
    ("time,x,y,z", EMPTY),
    (HEAD, EMPTY),
    ("time,x,y,z,module\n\n\n", EMPTY),
    *((HEAD + FIRST + row, NO_NUMBER) for row in WORDS),
    *((HEAD + FIRST + row, NOT_FINITE) for row in ENDLESS),
    (HEAD + "\n" + FIRST + "\n1,0,0,much\n", "line 5"),  # as an editor counts
    ("time,x,y,z,module\n1,0,0,0.6,0.5\n", NOT_WHOLE),
    ("time,x,y,z,module\n1,0,0,0.6,nan\n", NOT_WHOLE),
    ("time,x,y,z,module\n1,0,0,0.6,inf\n", NOT_WHOLE),
    (HEAD + FIRST + "2,0,0,0.6\n1,0,0,0.6\n", RISING + "1 after 2"),
    (HEAD + FIRST + "1,0,0,0.6\n1,0,0,0.6\n", RISING + "1 after 1"),
    (HEAD + "3,0,0,0.6\n2,0,0,0.6\n1,0,0,0.6\n", RISING + "2 after"),
    (HEAD + "-1,0,0,0.6\n1,0,0,0.6\n", "not negative, got -1"),
    (POINTED.replace("3,0,4", "0,0,0"), "an axis of length zero at time 2; give a dir"),
    ("time,x [kg],y,z\n" + FIRST, "write one of these: "),
    ("time [mm],x,y,z\n" + FIRST, "write one of these: "),
]


@pytest.mark.parametrize(("text", "told"), REFUSED)
def test_what_is_no_table_of_waypoints_is_refused_with_the_place(table, text, told):
    with pytest.raises(TargetError, match=told):
        load_waypoints(table(text))


def test_opposite_axes_cannot_be_interpolated(table):
    tracks = load_waypoints(table(POINTED.replace("3,0,4", "0,0,-2")))
    with pytest.raises(TargetError, match="target axis is zero"):
        waypoints_task("mine", tracks, TWIN)


@pytest.mark.parametrize(
    "content", [b"\xff\xfe\x00\x01\x02", b"time,x,y,z\n0,0,0,\xe9\0\n"]
)
def test_a_file_that_is_no_text_is_rejected(tmp_path, content):
    path = tmp_path / "picture.csv"
    path.write_bytes(content)
    with pytest.raises(TargetError, match=r"picture\.csv:? cannot be read as"):
        load_waypoints(path)


@pytest.mark.parametrize("module", [3, -4, 1e30])
def test_a_module_that_the_arm_lacks_is_rejected(table, module):
    tracks = load_waypoints(table(f"time,x,y,z,module\n1,0,0,0.6,{module}\n"))
    told = f"no module {int(module)}; this goal is for 3"
    with pytest.raises(TargetError, match=told):
        waypoints_task("mine", tracks, TWIN)
    told = f"module {int(module)} does not exist; 'twin_arm' has 3"
    with pytest.raises(TargetError, match=told):
        unreachable_waypoints(tracks, TWIN)


def test_the_tip_cannot_have_two_tracks(table):
    tracks = load_waypoints(table("time,x,y,z,module\n1,0,0,0.6,-1\n1,0,0,0.5,2\n"))
    told = r"'twin_arm' twice, by \[-1, 2\]; -1 and 2 are both its tip"
    with pytest.raises(TargetError, match=told):
        waypoints_task("mine", tracks, TWIN)


@pytest.mark.parametrize("time", ["0", "0.05", "100000.1", "1e18", "1e308"])
def test_a_last_time_that_makes_no_step_or_too_many_is_rejected(table, time):
    tracks = load_waypoints(table(f"time,x,y,z\n{time},0,0,0.6\n"))
    with pytest.raises(TargetError, match="between one step and 1000000 steps"):
        waypoints_task("mine", tracks, TWIN)


@pytest.mark.slow
def test_waypoints_out_of_reach_have_module_time_and_gap(table):
    """The arm is 0.6 m long, its base module 0.2 m."""
    rows = "1,0,0,0.7,-1\n2,0.1,0,0.58,-1\n0,0,0,0.2,0\n4,0,0,0.25,0\n"
    tracks = load_waypoints(table(f"time,x,y,z,module\n{rows}"))
    tip, base = unreachable_waypoints(tracks, TWIN)
    assert (tip.module, tip.time, base.module, base.time) == (-1, 1.0, 0, 4.0)
    assert (tip.gap, base.gap) == pytest.approx((0.1, 0.05), abs=1e-4)


def test_gaps_below_a_hundredth_of_the_arm_are_ignored(table):
    tracks = load_waypoints(table("time,x,y,z\n1,0,0,0.605\n2,0,0,0.607\n"))
    assert [far.time for far in unreachable_waypoints(tracks, TWIN)] == [2.0]


def test_positions_in_millimeters_are_refused(twin):
    far = Waypoints(-1, np.array([1.0, 2.0]), np.full((2, 3), 300.0), None)
    told = (
        r"a waypoint of .millimeters. has a coordinate of 300 m.* 0.6 m; .* in meters"
    )
    with pytest.raises(TargetError, match=told):
        waypoints_task("millimeters", [far], twin)
