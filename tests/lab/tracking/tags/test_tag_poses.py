import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from painted_tags import CAMERA, LAYOUT, collar_pose, errors, picture

from s2c2a.lab.tracking.tags import TagDropReason, TagLayout, estimate_poses
from s2c2a.lab.tracking.tags.detection import TagError

BODY = "end-1"
ONE_TAG = TagLayout(tags=(LAYOUT.by_id[10],))
TURNED = collar_pose(turn_deg=135)
BASE = collar_pose((-0.1, 0.05, 0.5), turn_deg=50)
TIP = collar_pose((0.1, -0.05, 0.45), turn_deg=120)


@pytest.mark.parametrize("turn", [-45, -20, 0, 15, 40, 90, 160])
@pytest.mark.parametrize("tilt", [-30, 0, 25])
def test_a_collar_is_measured_within_a_millimeter_and_a_degree(turn, tilt):
    true = collar_pose(turn_deg=turn + 90, tilt_deg=tilt)
    found = estimate_poses(picture({BODY: true}), CAMERA, LAYOUT, {BODY: true})
    distance, angle = errors(found.poses[BODY], true)
    assert distance < 1.0
    assert angle < 1.0


def test_base_and_tip_are_measured_in_one_picture():
    found = estimate_poses(picture({"base": BASE, BODY: TIP}), CAMERA, LAYOUT)
    assert errors(found.poses["base"], BASE)[0] < 1.5
    assert errors(found.poses[BODY], TIP)[0] < 1.5


def test_of_two_poses_of_a_far_tag_only_a_near_previous_one_decides():
    true = collar_pose((0.0, 0.0, 0.65), turn_deg=-80, tilt_deg=0)
    other = collar_pose((0.0, 0.0, 0.65), turn_deg=90, tilt_deg=0)
    image = picture({BODY: true}, layout=ONE_TAG)
    ambiguous = estimate_poses(image, CAMERA, ONE_TAG)
    assert ambiguous.poses == {}
    assert ambiguous.dropped[TagDropReason.AMBIGUOUS] == 1
    assert estimate_poses(image, CAMERA, ONE_TAG, {BODY: other}).poses == {}
    found = estimate_poses(image, CAMERA, ONE_TAG, {BODY: true})
    assert errors(found.poses[BODY], true)[1] < 3.0


@pytest.mark.parametrize("motion", [(0, 0), (4, 0), (8, 0), (0, 12), (15, 15), (30, 0)])
def test_a_moving_tag_is_missing_or_right(motion):
    image = picture({BODY: TURNED}, motion=motion, blur=0)
    for pose in estimate_poses(image, CAMERA, LAYOUT).poses.values():
        distance, angle = errors(pose, TURNED)
        assert distance < 5.0
        assert angle < 3.0


@pytest.mark.parametrize("blur", [2.5, 4.0, 8.0])
def test_a_blurred_tag_is_missing(blur):
    image = picture({BODY: TURNED}, noise=0, blur=blur)
    assert estimate_poses(image, CAMERA, LAYOUT).poses == {}


@pytest.mark.slow
def test_a_covered_tag_is_missing_or_right():
    clear = estimate_poses(picture({BODY: TURNED}), CAMERA, LAYOUT)
    corners = np.concatenate([view.corners for view in clear.views])
    left, top = corners.min(axis=0).astype(int)
    right, bottom = corners.max(axis=0).astype(int)
    random = np.random.default_rng(0)
    for _ in range(40):
        x, y = random.integers((left - 10, top - 10), (right, bottom))
        width, height = random.integers(3, 40, 2)
        image = picture({BODY: TURNED}, covered=(x, y, width, height))
        for pose in estimate_poses(image, CAMERA, LAYOUT).poses.values():
            distance, angle = errors(pose, TURNED)
            assert distance < 5.0
            assert angle < 4.0


def test_all_of_a_tag_covered_leaves_the_other_body():
    image = picture({"base": BASE, BODY: TIP}, covered=(360, 0, 280, 360))
    assert set(estimate_poses(image, CAMERA, LAYOUT).poses) == {"base"}


def test_a_tag_that_is_mounted_elsewhere_is_left_out_or_the_body_is():
    x, y, z = LAYOUT.by_id[11].position
    moved = LAYOUT.by_id[11].model_copy(update={"position": (x, y, z + 0.02)})
    others = [tag for tag in LAYOUT.tags if tag.id != 11]
    wrong = TagLayout(tags=(*others, moved))
    found = estimate_poses(picture({BODY: TURNED}), CAMERA, wrong, {BODY: TURNED})
    assert found.dropped[TagDropReason.MISFIT] >= 1


def test_an_id_that_occurs_twice_is_dropped():
    near = collar_pose((0.1, 0, 0.4), turn_deg=-70)
    image = picture({BODY: near}, layout=ONE_TAG)
    twice = np.concatenate([image[:, 320:], image[:, 320:]], axis=1)
    found = estimate_poses(twice, CAMERA, ONE_TAG)
    assert found.poses == {}
    assert found.dropped[TagDropReason.DUPLICATE] == 2


def test_tags_of_other_projects_are_counted_and_ignored():
    image = picture({BODY: TURNED})
    found = estimate_poses(image, CAMERA, ONE_TAG)
    assert found.dropped[TagDropReason.UNKNOWN_TAG] >= 1


def test_a_distant_tag_is_too_small():
    true = collar_pose((0, 0, 2.5), turn_deg=-60)
    assert estimate_poses(picture({BODY: true}), CAMERA, LAYOUT).poses == {}


def test_color_and_gray_pictures_give_the_same_poses():
    gray = picture({BODY: TURNED})
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
        image = picture({BODY: TURNED})[random.permutation(360)]
    assert estimate_poses(image, CAMERA, LAYOUT).poses == {}
