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
    "capsule": (
        "start = [0.1, 0, 0]\nend = [0.3, 0, 0]\nradius = 0.02",
        [0.32, 0.0, 0.0],
    ),
    "cylinder": (
        "start = [0, 0, 0]\nend = [0, 0.2, 0]\nradius = 0.03",
        [0.03, 0.1, 0.0],
    ),
    "box": (
        "center = [0.1, 0, 0]\nsize = [0.2, 0.1, 0.1]\nrotation_deg = [0, 0, 90]",
        [0.1, 0.1, 0.0],
    ),
    "half_space": ("point = [0, 0.4, 0]\nnormal = [0, -2, 0]", [0.3, 0.4, 0.2]),
}
"""Keys of every kind, and a point of its surface [m]."""
CUBE = "OFF\n8 12 0\n" + "\n".join(
    [f"{x} {y} {z}" for x in (0, 100) for y in (0, 100) for z in (0, 100)]
    + [
        f"3 {face}"
        for face in (
            "0 1 3",
            "0 3 2",
            "4 6 7",
            "4 7 5",
            "0 4 5",
            "0 5 1",
            "2 3 7",
            "2 7 6",
            "0 2 6",
            "0 6 4",
            "1 5 7",
            "1 7 3",
        )
    ]
)


def scene_of(folder, text):
    path = folder / "scene.toml"
    path.write_text(text, "utf-8")
    return load_scene(path)


def clearance_at(rows, point):
    gaps = distances(np.array(point), rows[..., CENTER], rows[..., CORE])
    return (gaps - rows[..., THRESHOLD]).min()


@pytest.mark.parametrize("kind", SOLIDS)
def test_a_solid_lies_where_its_file_says(tmp_path, kind):
    keys, point = SOLIDS[kind]
    text = f'[[obstacles]]\nkind = "{kind}"\n{keys}\nclearance = 0.01\n'
    (solid,) = scene_of(tmp_path, text).obstacles
    assert clearance_at(solid.rows(), point) == pytest.approx(-0.01, abs=2e-4)


@pytest.mark.parametrize("kind", SOLIDS)
def test_a_solid_is_known_by_its_row_and_written_back(tmp_path, kind):
    text = f'[[obstacles]]\nkind = "{kind}"\n{SOLIDS[kind][0]}\n'
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
    arm = load_arm("twin_arm")
    own = Goal.of(3).with_obstacles([[0.3, 0, 0.2]], [0.04])
    scene = Scene(obstacles=(Sphere(center=(0, 0.3, 0.4), radius=0.05),))
    task = scene.around(Task("point", (own,) * 4), arm)
    assert task.obstacles().shape == (4, 2, 12)
    names = {score.metric for score in task.scores}
    assert {"clearance", "clearance of the arm"} <= names


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[[obstacles]]\nradius = 0.1\n", "kind"),
        ('[[obstacles]]\nkind = "cube"\n', "kind"),
        ('[[obstacles]]\nkind = "sphere"\ncenter = [0, 0, 1]\n', "radius"),
        ('[[obstacles]]\nkind = "sphere"\ncentre = [0, 0, 1]\nradius = 1\n', "center"),
        ('[[obstacles]]\nkind = "mesh"\nfile = "none.stl"\n', "none.stl"),
        (
            '[[obstacles]]\nkind = "half_space"\npoint = [0, 0, 0]\nnormal = [0, 0, 0]',
            "direction",
        ),
        ('[[obstacles]]\nkind = "mesh"\nfile = "../a.stl"\n', "beside the scene file"),
        (
            '[[obstacles]]\nkind = "half_space"\npoint = [0, 0, 0.1]\nnormal = [0, 0, 1]',
            "contains the base",
        ),
        ("obstacles = 3\n", "list"),
        ("[[obstacles\n", "scene.toml"),
    ],
)
def test_a_fault_of_a_file_is_named(tmp_path, text, words):
    with pytest.raises(TargetError, match=words):
        scene_of(tmp_path, text)


def test_too_many_obstacles_are_refused(tmp_path):
    one = '[[obstacles]]\nkind = "sphere"\ncenter = [0, 0, 1]\nradius = 0.1\n'
    with pytest.raises(TargetError, match=f"at most {MAX_OBSTACLES}"):
        scene_of(tmp_path, one * (MAX_OBSTACLES + 1))


def test_obstacles_of_a_scene_keep_their_rows_when_those_of_the_task_appear():
    rest = Goal.of(3)
    later = rest.with_obstacles([[0.3, 0, 0.2]], [0.04])
    scene = Scene(obstacles=(Sphere(center=(0, 0.3, 0.4), radius=0.05),))
    task = scene.around(Task("later", (rest, later)), load_arm("twin_arm"))
    np.testing.assert_allclose(task.obstacles()[:, 1, :3], [[0, 0.3, 0.4]] * 2)


def test_a_body_does_not_touch_what_its_arm_is_mounted_on():
    arm = load_arm("twin_arm")
    modules = tuple(one.model_copy(update={"radius": 0.05}) for one in arm.modules)
    guarded = GuardedPoints.of(arm.model_copy(update={"modules": modules}), "arm")
    heights = arm.length * np.arange(1, 16) / 15
    assert (heights - guarded.radii > 0.0).all()
    assert guarded.radii[-1] == np.float32(0.05)


def test_a_scene_in_millimeters_is_refused():
    scene = Scene(obstacles=(Sphere(center=(200, 150, 500), radius=30),))
    with pytest.raises(TargetError, match="write lengths in meters"):
        scene.around(Task("point", (Goal.of(3),)), load_arm("twin_arm"))


def test_an_arm_may_stand_on_a_half_space(tmp_path):
    floor = (
        'kind = "half_space"\npoint = [0, 0, 0]\nnormal = [0, 0, 1]\nclearance = 0.01'
    )
    scene_of(tmp_path, f"[[obstacles]]\n{floor}\n")
