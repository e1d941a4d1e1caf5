"""Scene files: every kind of obstacle, its surface, its time, and refusals."""

import os

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.errors import TargetError
from s2c2a.goals import MAX_OBSTACLES, Goal
from s2c2a.live.scene_files import save_scene, solid_of
from s2c2a.obstacles import CENTER, CORE, THRESHOLD, distances
from s2c2a.planning.terms import GuardedPoints
from s2c2a.tasks import Task
from s2c2a.tasks.meshes import covering_spheres
from s2c2a.tasks.scenes import Scene, Sphere, load_scene

SOLIDS = {
    "sphere": ("center = [0.1, 0, 0.5]\nradius = 0.05", [0.1, 0.0, 0.55]),
    "capsule": ("start = [0.1, 0, 0]\nend = [0.3, 0, 0]\nradius = 0.02", [0.32, 0, 0]),
    "cylinder": ("start = [0, 0, 0]\nend = [0, 0.2, 0]\nradius = 0.03", [0.03, 0.1, 0]),
    "box": (
        "center = [0.1, 0, 0]\nsize = [0.2, 0.1, 0.1]\nrotation_deg = [0, 0, 90]",
        [0.1, 0.1, 0.0],
    ),
    "half_space": ("point = [0, 0.4, 0]\nnormal = [0, -2, 0]", [0.3, 0.4, 0.2]),
}
"""Keys of every kind, and a point of its surface [m]."""
FACES = "013 032 467 475 045 051 237 276 026 064 157 173"
"""Corners of the triangles of a cube."""
CUBE = "\n".join(
    ["OFF", "8 12 0"]
    + [f"{x} {y} {z}" for x in (0, 100) for y in (0, 100) for z in (0, 100)]
    + [" ".join(["3", *face]) for face in FACES.split()]
)


SCENE = Scene(obstacles=(Sphere(center=(0, 0.3, 0.4), radius=0.05),))
TWIN = load_arm("twin_arm")


def scene_of(folder, text):
    path = folder / "scene.toml"
    path.write_text(text, "utf-8")
    return load_scene(path)


def clearance_at(rows, point):
    gaps = distances(np.array(point), rows[..., CENTER], rows[..., CORE])
    return (gaps - rows[..., THRESHOLD]).min()


@pytest.mark.parametrize("kind", SOLIDS)
def test_a_solid_lies_where_its_file_says_and_is_written_back(tmp_path, kind):
    keys, point = SOLIDS[kind]
    text = f'[[obstacles]]\nkind = "{kind}"\n{keys}\n'
    (solid,) = scene_of(tmp_path, f"{text}clearance = 0.01\n").obstacles
    assert clearance_at(solid.rows(), point) == pytest.approx(-0.01, abs=2e-4)
    (solid,) = scene_of(tmp_path, text).obstacles
    again = solid_of(solid.rows()[0])
    assert type(again) is type(solid)
    np.testing.assert_allclose(again.rows(), solid.rows(), atol=2e-5)
    save_scene(Scene(obstacles=(again,)), tmp_path / "copy.toml")
    assert load_scene(tmp_path / "copy.toml").obstacles == (again,)


def test_a_mesh_leads_to_no_other_files_and_takes_little_memory(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    box = trimesh.creation.box()
    os.mkfifo(tmp_path / "pipe.mtl")
    text = f"mtllib pipe.mtl\n{box.export(file_type='obj')}"
    (tmp_path / "box.obj").write_text(text)
    assert len(covering_spheres(tmp_path / "box.obj", 9).spheres) > 1
    triangles = np.random.default_rng(0).random((100_000, 3, 3))
    trimesh.Trimesh(**trimesh.triangles.to_kwargs(triangles)).export(tmp_path / "x.stl")
    with pytest.raises(TargetError, match=r"x\.stl.* more memory than a file may take"):
        covering_spheres(tmp_path / "x.stl", 9)


def test_spheres_contain_the_solid_of_a_mesh(tmp_path):
    pytest.importorskip("trimesh")
    (tmp_path / "cube.off").write_text(CUBE, "utf-8")
    mesh = 'kind = "mesh"\nfile = "cube.off"\nscale = 0.001\nposition = [0.2, 0, 0.3]\n'
    (solid,) = scene_of(tmp_path, f"[[obstacles]]\n{mesh}").obstacles
    rows = solid.rows()
    corners = np.stack(np.meshgrid(*[np.linspace(0, 0.1, 5)] * 3), -1).reshape(-1, 3)
    for corner in np.add(corners, [0.2, 0.0, 0.3]):
        assert clearance_at(rows, corner) <= 0.0
    beside = [0.2 - solid.excess - 1e-3, 0.05, 0.35]
    assert clearance_at(rows, beside) > 0.0
    assert solid.excess < 0.05


@pytest.mark.parametrize(
    ("scale", "words"),
    [
        (1.0, "100 x 100 x 100 m with scale = 1;"),
        (0.02, "contains the base.*2 x 2 x 2 m"),
        (1e-6, "unlikely size"),
    ],
)
def test_a_mesh_in_another_unit_is_refused_with_its_size(tmp_path, scale, words):
    pytest.importorskip("trimesh")
    (tmp_path / "cube.off").write_text(CUBE, "utf-8")
    mesh = f'kind = "mesh"\nfile = "cube.off"\nscale = {scale}\n'
    with pytest.raises(TargetError, match=words):
        scene_of(tmp_path, f"[[obstacles]]\n{mesh}position = [-0.5, -0.5, -0.5]\n")


def test_obstacles_appear_move_and_disappear(tmp_path):
    text = (
        '[[obstacles]]\nkind = "sphere"\ncenter = [0, 0, 0.5]\nradius = 0.05\n'
        "velocity = [0.1, 0, 0]\nappears = 1.0\ndisappears = 2.0\n"
    )
    rows = scene_of(tmp_path, text).rows_at(np.array([0.5, 1.0, 1.9, 2.0]))[:, 0]
    np.testing.assert_allclose(rows[:, THRESHOLD] > 0, [False, True, True, False])
    np.testing.assert_allclose(rows[1:3, 0], [0.1, 0.19])


def test_a_task_runs_beside_a_scene_and_its_own_obstacles():
    own = Goal.of(3).with_obstacles([[0.3, 0, 0.2]], [0.04])
    task = SCENE.around(Task("point", (own,) * 4), TWIN)
    assert task.obstacles().shape == (4, 2, 12)
    names = {score.metric for score in task.scores}
    assert {"clearance", "clearance of the arm"} <= names


ONE = "[[obstacles]]\n"
SPHERE = f'{ONE}kind = "sphere"\ncenter = [0, 0, 1]\nradius = 0.1\n'
HALF_SPACE = f'{ONE}kind = "half_space"\npoint = [0, 0, 0.1]\nnormal = [0, 0, 1]\n'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (f"{ONE}radius = 0.1\n", "kind"),
        (f'{ONE}kind = "cube"\n', "'kind' is 'cube'; write one of 'sphere', 'capsule'"),
        (SPHERE.replace("[[", "[").replace("]]", "]"), r"below \[\[its name\]\]"),
        (SPHERE.replace("[0, 0, 1]", "[0, 0]"), r"number 3 is missing \(got \[0, 0\]"),
        (SPHERE.replace("radius = 0.1\n", ""), "radius"),
        (SPHERE.replace("center", "centre"), "center"),
        (f'{ONE}kind = "mesh"\nfile = "none.stl"\n', "none.stl"),
        (HALF_SPACE.replace("[0, 0, 1]", "[0, 0, 0]"), "direction"),
        (f'{ONE}kind = "mesh"\nfile = "../a.stl"\n', "beside the scene file"),
        (HALF_SPACE, "contains the base"),
        (SPHERE * (MAX_OBSTACLES + 1), f"at most {MAX_OBSTACLES}"),
        ("obstacles = 3\n", "list"),
        ("[[obstacles\n", "scene.toml"),
    ],
)
def test_a_fault_of_a_file_is_named(tmp_path, text, words):
    with pytest.raises(TargetError, match=words):
        scene_of(tmp_path, text)


def test_an_arm_may_stand_on_a_half_space(tmp_path):
    scene_of(tmp_path, f"{HALF_SPACE.replace('0.1', '0')}clearance = 0.01\n")


def test_obstacles_of_a_scene_keep_their_rows_when_those_of_the_task_appear():
    rest = Goal.of(3)
    later = rest.with_obstacles([[0.3, 0, 0.2]], [0.04])
    task = SCENE.around(Task("later", (rest, later)), TWIN)
    np.testing.assert_allclose(task.obstacles()[:, 1, :3], [[0, 0.3, 0.4]] * 2)


def test_a_body_does_not_touch_what_its_arm_is_mounted_on():
    modules = tuple(one.model_copy(update={"radius": 0.05}) for one in TWIN.modules)
    guarded = GuardedPoints.of(TWIN.model_copy(update={"modules": modules}), "arm")
    heights = TWIN.length * np.arange(1, 16) / 15
    assert (heights - guarded.radii > 0.0).all()
    assert guarded.radii[-1] == np.float32(0.05)


def test_a_copy_of_a_solid_is_checked_and_finds_its_file(tmp_path):
    with pytest.raises(TargetError, match=r"in the scene .*\n  radius: write 0.0001"):
        SCENE.obstacles[0].model_copy(update={"radius": -1})
    (tmp_path / "cube.off").write_text(CUBE)
    mesh = 'kind = "mesh"\nfile = "cube.off"\nscale = 0.001\nposition = [0.2, 0, 0.3]\n'
    (solid,) = scene_of(tmp_path, f"[[obstacles]]\n{mesh}").obstacles
    pytest.importorskip("trimesh")
    assert len(solid.model_copy(update={"spheres": 3}).rows()) <= 3


def test_a_scene_in_millimeters_is_refused():
    scene = Scene(obstacles=(Sphere(center=(200, 150, 500), radius=30),))
    with pytest.raises(TargetError, match="write lengths in meters"):
        scene.around(Task("point", (Goal.of(3),)), TWIN)
