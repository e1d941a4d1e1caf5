import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from painted_tags import CAMERA, LAYOUT, SHARP, collar_pose, errors, picture
from pictures import Effects

from s2c2a.lab.tracking.tags import TagDropReason, TagLayout, estimate_poses
from s2c2a.lab.tracking.tags.detection import TagError
from s2c2a.lab.tracking.tags.layout import Tag

BODY = "end-1"


def one_tag(id: int = 10) -> TagLayout:
    return TagLayout(tags=(LAYOUT.by_id[id],))


@pytest.mark.parametrize("turn", [-45, -20, 0, 15, 40, 90, 160])
@pytest.mark.parametrize("tilt", [-30, 0, 25])
def test_a_collar_is_measured_within_a_millimeter_and_a_degree(turn, tilt):
    true = collar_pose(turn_deg=turn + 90, tilt_deg=tilt)
    found = estimate_poses(picture({BODY: true}), CAMERA, LAYOUT, {BODY: true})
    distance, angle = errors(found.poses[BODY], true)
    assert distance < 1.0
    assert angle < 1.0


def test_base_and_tip_are_measured_in_one_picture():
    base = collar_pose((-0.1, 0.05, 0.5), turn_deg=50)
    tip = collar_pose((0.1, -0.05, 0.45), turn_deg=120)
    found = estimate_poses(picture({"base": base, BODY: tip}), CAMERA, LAYOUT)
    assert errors(found.poses["base"], base)[0] < 1.5
    assert errors(found.poses[BODY], tip)[0] < 1.5


def test_a_tag_that_looks_straight_at_a_far_camera_is_ambiguous():
    true = collar_pose((0.0, 0.0, 0.65), turn_deg=-80, tilt_deg=0)
    image = picture({BODY: true}, layout=one_tag())
    found = estimate_poses(image, CAMERA, one_tag())
    assert found.poses == {}
    assert found.dropped[TagDropReason.AMBIGUOUS] == 1


def test_the_previous_pose_decides_between_two_poses():
    true = collar_pose((0.0, 0.0, 0.65), turn_deg=-80, tilt_deg=0)
    image = picture({BODY: true}, layout=one_tag())
    found = estimate_poses(image, CAMERA, one_tag(), {BODY: true})
    assert errors(found.poses[BODY], true)[1] < 3.0


def test_a_far_previous_pose_does_not_decide():
    true = collar_pose((0.0, 0.0, 0.65), turn_deg=-80, tilt_deg=0)
    other = collar_pose((0.0, 0.0, 0.65), turn_deg=90, tilt_deg=0)
    image = picture({BODY: true}, layout=one_tag())
    assert estimate_poses(image, CAMERA, one_tag(), {BODY: other}).poses == {}


@pytest.mark.parametrize("motion", [(0, 0), (4, 0), (8, 0), (0, 12), (15, 15), (30, 0)])
def test_a_moving_tag_is_missing_or_right(motion):
    true = collar_pose(turn_deg=135)
    image = picture({BODY: true}, Effects(noise=1.5), motion=motion)
    for pose in estimate_poses(image, CAMERA, LAYOUT).poses.values():
        distance, angle = errors(pose, true)
        assert distance < 5.0
        assert angle < 3.0


@pytest.mark.parametrize("blur", [2.5, 4.0, 8.0])
def test_a_blurred_tag_is_missing(blur):
    image = picture({BODY: collar_pose(turn_deg=135)}, Effects(blur=blur))
    assert estimate_poses(image, CAMERA, LAYOUT).poses == {}


@pytest.mark.slow
def test_a_covered_tag_is_missing_or_right():
    true = collar_pose(turn_deg=135)
    clear = estimate_poses(picture({BODY: true}), CAMERA, LAYOUT)
    corners = np.concatenate([view.corners for view in clear.views])
    left, top = corners.min(axis=0).astype(int)
    right, bottom = corners.max(axis=0).astype(int)
    random = np.random.default_rng(0)
    for _ in range(40):
        x, y = random.integers((left - 10, top - 10), (right, bottom))
        width, height = random.integers(3, 40, 2)
        image = picture({BODY: true}, covered=(x, y, width, height))
        for pose in estimate_poses(image, CAMERA, LAYOUT).poses.values():
            distance, angle = errors(pose, true)
            assert distance < 5.0
            assert angle < 4.0


def test_all_of_a_tag_covered_leaves_the_other_body():
    base = collar_pose((-0.1, 0.05, 0.5), turn_deg=50)
    tip = collar_pose((0.1, -0.05, 0.45), turn_deg=120)
    image = picture({"base": base, BODY: tip}, covered=(360, 0, 280, 360))
    assert set(estimate_poses(image, CAMERA, LAYOUT).poses) == {"base"}


def test_a_tag_that_is_mounted_elsewhere_is_left_out_or_the_body_is():
    true = collar_pose(turn_deg=135)
    tags = []
    for tag in LAYOUT.tags:
        shift = 0.02 if tag.id == 11 else 0.0
        x, y, z = tag.position
        tags.append(tag.model_copy(update={"position": (x, y, z + shift)}))
    wrong = TagLayout(tags=tuple(tags))
    found = estimate_poses(picture({BODY: true}), CAMERA, wrong, {BODY: true})
    assert found.dropped[TagDropReason.MISFIT] >= 1


def test_an_id_that_occurs_twice_is_dropped():
    tag = LAYOUT.by_id[10]
    other = Tag(
        id=11, body="other", size=tag.size, position=(0, 0, 0), rotation=(0, 0, 0, 1)
    )
    near = collar_pose((0.1, 0, 0.4), turn_deg=-70)
    image = picture({BODY: near}, layout=TagLayout(tags=(tag,)))
    twice = np.concatenate([image[:, 320:], image[:, 320:]], axis=1)
    found = estimate_poses(twice, CAMERA, TagLayout(tags=(tag, other)))
    assert found.poses == {}
    assert found.dropped[TagDropReason.DUPLICATE] == 2


def test_tags_of_other_projects_are_counted_and_ignored():
    image = picture({BODY: collar_pose(turn_deg=135)})
    found = estimate_poses(image, CAMERA, one_tag())
    assert found.dropped[TagDropReason.UNKNOWN_TAG] >= 1


def test_a_distant_tag_is_too_small():
    true = collar_pose((0, 0, 2.5), turn_deg=-60)
    assert estimate_poses(picture({BODY: true}), CAMERA, LAYOUT).poses == {}


def test_color_and_gray_pictures_give_the_same_poses():
    gray = picture({BODY: collar_pose(turn_deg=135)})
    color = np.repeat(gray[..., None], 3, axis=-1)
    first = estimate_poses(gray, CAMERA, LAYOUT).poses[BODY]
    second = estimate_poses(color, CAMERA, LAYOUT).poses[BODY]
    assert errors(first, second)[0] < 0.01


@pytest.mark.parametrize(
    ("image", "reason"),
    [
        (np.zeros((360, 640), np.float64), TagDropReason.MALFORMED),
        (np.zeros((360, 640, 4), np.uint8), TagDropReason.MALFORMED),
        (np.zeros(5, np.uint8), TagDropReason.MALFORMED),
        (None, TagDropReason.MALFORMED),
        (np.zeros((0, 0), np.uint8), TagDropReason.WRONG_SIZE),
        (np.zeros((720, 1280), np.uint8), TagDropReason.WRONG_SIZE),
    ],
)
def test_what_is_no_picture_of_the_camera_is_refused(image, reason):
    with pytest.raises(TagError) as caught:
        estimate_poses(image, CAMERA, LAYOUT)
    assert caught.value.reason is reason


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(["noise", "blocks", "scrambled"]))
def test_random_pictures_never_crash_and_show_nothing(seed, kind):
    random = np.random.default_rng(seed)
    if kind == "noise":
        image = random.integers(0, 256, (360, 640), dtype=np.uint8)
    elif kind == "blocks":
        cells = random.integers(0, 2, (45, 80), dtype=np.uint8) * 255
        image = np.kron(cells, np.ones((8, 8), np.uint8))
    else:
        image = picture({BODY: collar_pose(turn_deg=135)}, SHARP).copy()
        rows = random.permutation(360)
        image = image[rows]
    assert estimate_poses(image, CAMERA, LAYOUT).poses == {}
