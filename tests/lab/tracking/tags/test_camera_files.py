import json

import pytest
from painted_tags import CAMERA, LAYOUT

from s2c2a.lab.tracking.tags import (
    TagLayout,
    load_camera,
    load_layout,
    save_camera,
    save_layout,
)
from s2c2a.lab.tracking.tags.camera import CameraError
from s2c2a.lab.tracking.tags.layout import LayoutError


def test_cameras_and_layouts_come_back_from_their_files(tmp_path):
    save_camera(CAMERA, tmp_path / "camera.json")
    assert load_camera(tmp_path / "camera.json") == CAMERA
    save_layout(LAYOUT, tmp_path / "tags.json")
    assert load_layout(tmp_path / "tags.json") == LAYOUT


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("width", 0),
        ("width", 1e9),
        ("width", "640"),
        ("height", None),
        ("focal_lengths", [0, 560]),
        ("focal_lengths", [560]),
        ("focal_lengths", [float("nan"), 560]),
        ("center", [-5, 100]),
        ("distortion", [1e300, 0, 0, 0, 0]),
        ("distortion", []),
        ("rms", -1),
        ("format", 2),
        ("unknown", 1),
        ("board", {"columns": 2}),
        ("board", {"square": 0.03, "marker": 0.04}),
    ],
)
def test_a_wrong_value_is_named(tmp_path, key, value):
    values = {**CAMERA.model_dump(mode="json"), key: value}
    (tmp_path / "camera.json").write_text(json.dumps(values))
    with pytest.raises(CameraError, match=key):
        load_camera(tmp_path / "camera.json")


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("id", 587),
        ("id", -1),
        ("size", 0),
        ("body", ""),
        ("position", [0, 0, 1e9]),
        ("rotation", [0, 0, 0, 0]),
        ("rotation", [0, 0, 0, 2]),
    ],
)
def test_a_wrong_tag_is_named(tmp_path, key, value):
    values = LAYOUT.model_dump(mode="json")
    values["tags"][0][key] = value
    (tmp_path / "tags.json").write_text(json.dumps(values))
    with pytest.raises(LayoutError, match=key):
        load_layout(tmp_path / "tags.json")


def test_an_id_must_occur_once(tmp_path):
    values = LAYOUT.model_dump(mode="json")
    values["tags"][1]["id"] = values["tags"][0]["id"]
    (tmp_path / "tags.json").write_text(json.dumps(values))
    with pytest.raises(LayoutError, match="twice"):
        load_layout(tmp_path / "tags.json")


def test_ids_tell_body_and_side():
    layout = TagLayout.collars(3)
    assert [tag.id for tag in layout.tags if tag.body == "base"] == [0, 1, 2, 3]
    assert [tag.id for tag in layout.tags if tag.body == "end-2"] == [20, 21, 22, 23]
    assert [tag.id for tag in layout.tags if tag.body == "end-3"][-1] == 34


def test_tags_of_a_collar_look_outward_and_stand_upright():
    directions = [(1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0), (0, 0, 1)]
    tags = [tag for tag in TagLayout.collars(1).tags if tag.body == "end-1"]
    for tag, direction in zip(tags, directions, strict=True):
        assert tag.pose.z_axis == pytest.approx(direction, abs=1e-12)
        assert tag.position == pytest.approx([0.032 * one for one in direction])
    for tag in tags[:4]:
        assert tag.pose.matrix[:, 1] == pytest.approx((0, 0, 1), abs=1e-12)
        assert tag.corners[:2, 2] == pytest.approx([0.02, 0.02])


@pytest.mark.parametrize(
    "options",
    [{"modules": 0}, {"modules": 10}, {"size": 0.1}, {"bodies": ["tip"]}],
)
def test_collars_that_cannot_be_are_refused(options):
    with pytest.raises(LayoutError):
        TagLayout.collars(**{"modules": 2, **options})
