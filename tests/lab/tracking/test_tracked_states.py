"""States of modules follow from tracked bodies."""

import numpy as np
import pytest

from s2c2a.lab.tracking import ModuleEnds, Pose, PoseFrame, TrackingError

QUARTER_ABOUT_X = np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
QUARTER_ABOUT_Z = np.array([0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)])
NO_TURN = np.array([0.0, 0.0, 0.0, 1.0])


def pose(x, y, z, rotation=NO_TURN):
    return Pose(np.array([x, y, z], dtype=float), rotation)


def frame_of(**poses):
    named = {name.replace("_", "-"): value for name, value in poses.items()}
    return PoseFrame(arrival_time=10.0, source_time=3.0, number=4, poses=named)


def test_a_straight_arm_on_a_shifted_base_points_along_z():
    frame = frame_of(base=pose(1, 2, 3), end_1=pose(1, 2, 3.2), end_2=pose(1, 2, 3.4))
    tracked = ModuleEnds.of(2).states(frame)
    expected = [[0, 0, 0.2, 0, 0, 1], [0, 0, 0.4, 0, 0, 1]]
    np.testing.assert_allclose(tracked, expected, atol=1e-12)


def test_states_are_in_the_frame_of_a_turned_base():
    frame = frame_of(
        base=pose(0, 0, 0, QUARTER_ABOUT_Z), end_1=pose(0, 0.1, 0.2, QUARTER_ABOUT_X)
    )
    tracked = ModuleEnds.of(1).states(frame)
    # world y is x of the base, world -y is its -x
    np.testing.assert_allclose(tracked, [[0.1, 0, 0.2, -1, 0, 0]], atol=1e-12)


def test_a_common_motion_of_all_bodies_changes_nothing():
    motion = pose(0.3, -0.2, 0.1, QUARTER_ABOUT_X)
    base, end = pose(1, 2, 3, QUARTER_ABOUT_Z), pose(1.1, 2, 3.2, QUARTER_ABOUT_X)
    ends = ModuleEnds.of(1)
    still = ends.states(frame_of(base=base, end_1=end))
    moved = ends.states(frame_of(base=motion @ base, end_1=motion @ end))
    np.testing.assert_allclose(still, moved, atol=1e-12)


def test_the_world_frame_can_replace_the_base():
    ends = ModuleEnds.of(1, base=None, base_offset=pose(0, 0, 0.1))
    states = ends.states(frame_of(end_1=pose(0, 0, 0.3)))
    np.testing.assert_allclose(states, [[0, 0, 0.2, 0, 0, 1]], atol=1e-12)


def test_offsets_move_from_markers_to_the_frames_of_the_arm():
    ends = ModuleEnds.of(
        1,
        base_offset=pose(0, 0, 0.05, QUARTER_ABOUT_X),
        end_offsets={"end-1": pose(0, 0, -0.01, QUARTER_ABOUT_X)},
    )
    frame = frame_of(base=pose(0, 0, 0), end_1=pose(0.1, 0, 0.26))
    states = ends.states(frame)
    # the arm's y axis is up in the world, its z axis is -y
    np.testing.assert_allclose(states, [[0.1, 0.2, 0, 0, 0, 1]], atol=1e-12)


@pytest.mark.parametrize(
    "wrong",
    [
        {"ends": ()},
        {"ends": ("a", "a")},
        {"ends": ("base",)},
        {"ends": ("a",), "end_offsets": {"b": Pose.identity()}},
    ],
)
def test_an_impossible_assignment_is_rejected(wrong):
    with pytest.raises(TrackingError):
        ModuleEnds(**wrong)
