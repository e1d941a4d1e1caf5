"""Pictures of a simulated arm with tags, rendered by MuJoCo.

The scene holds the tags and, for the eye and as an obstacle, the arm. It has no
physics: bodies are placed at the poses that the simulation of the arm gives.
"""

import sys
from collections.abc import Mapping
from importlib import import_module
from itertools import pairwise

import mujoco
import numpy as np

from s2c2a.errors import S2C2AError
from s2c2a.lab.tracking.poses import Pose
from s2c2a.lab.tracking.tags.camera import CameraModel
from s2c2a.lab.tracking.tags.layout import SHEET, Tag, TagLayout
from s2c2a.lab.tracking.tags.pictures import (
    BACKGROUND,
    OVERSAMPLING,
    WHITE,
    Effects,
    Lens,
    tag_texture,
)

_CAMERA = "camera"
# z forward and y down (camera frame) to z backward and y up (MuJoCo)
_FROM_MUJOCO = Pose.measured((0, 0, 0), (1.0, 0, 0, 0))
_THICKNESS = 0.0005  # m; of the board behind a tag
_ARM_POINTS = 9  # of a module
_ARM_COLOR = np.array([0.25, 0.3, 0.35, 1.0], dtype=np.float32)
_MAX_GEOMS = 2000
_NEAR = 0.02  # m
_FAR = 20.0  # m
_CONTEXTS = {"linux": ("egl", "osmesa", "glfw")}
_OTHER_CONTEXTS = ("glfw",)


class TagScene:
    """A renderer of tags and arm. Use it in one thread at a time.

    Attributes:
        lens: of the camera.
    """

    def __init__(
        self,
        camera: CameraModel,
        layout: TagLayout,
        arm_radius: float = 0.02,
        oversampling: int = OVERSAMPLING,
    ):
        """Open a graphics context without a window.

        Args:
            camera: its model.
            layout: of the tags.
            arm_radius: of the arm between the bodies [m]; 0 for none.
            oversampling: rendered pixels for one of the camera, along each axis.

        Raises:
            S2C2AError: this computer has no graphics without a window.
        """
        self.lens = Lens(camera, oversampling)
        self._layout = layout
        self._arm_radius = arm_radius
        self._model = _build_scene(layout, self.lens)
        self._context = _open_context(self.lens.width, self.lens.height)
        self._data = mujoco.MjData(self._model)
        self._scene = mujoco.MjvScene(self._model, _MAX_GEOMS)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False
        self._scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        self._renderer = mujoco.MjrContext(
            self._model, mujoco.mjtFontScale.mjFONTSCALE_100
        )
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._renderer)

    def close(self) -> None:
        """Release the graphics; allowed more than once."""
        if self._context is not None:
            self._context.make_current()
            self._renderer.free()
            self._context.free()
            self._context = None

    def render(
        self,
        poses: Mapping[str, Pose],
        camera: Pose,
        effects: Effects | None = None,
    ) -> np.ndarray:
        """Return a picture, 8 bit, shape (height, width, 3), blue, green, red.

        Args:
            poses: `T_world_body` by name; a body of the layout without a pose is
                not in the picture.
            camera: `T_world_camera`.
            effects: blur, noise, and what is hidden.

        Raises:
            S2C2AError: the scene is closed.
        """
        if self._context is None:
            raise S2C2AError("the scene is closed; make a new one")
        self._place(poses, camera)
        self._context.make_current()
        # contexts of other scenes may have been used in between
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._renderer)
        self._update_scene(poses)
        size = (self.lens.height, self.lens.width)
        image = np.empty((*size, 3), np.uint8)
        viewport = mujoco.MjrRect(0, 0, self.lens.width, self.lens.height)
        mujoco.mjr_render(viewport, self._scene, self._renderer)
        mujoco.mjr_readPixels(image, None, viewport, self._renderer)
        # rows from the top, and the order of OpenCV
        ideal = np.ascontiguousarray(image[::-1, :, ::-1])
        return self.lens.picture(ideal, effects)

    def _place(self, poses: Mapping[str, Pose], camera: Pose) -> None:
        away = Pose.measured((0, 0, 2 * _FAR), (0, 0, 0, 1.0))
        for name in self._layout.bodies:
            self._place_one(f"body {name}", poses.get(name, away))
        self._place_one(_CAMERA, camera @ _FROM_MUJOCO)
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)

    def _place_one(self, name: str, pose: Pose) -> None:
        number = self._model.body(name).mocapid[0]
        self._data.mocap_pos[number] = pose.position
        self._data.mocap_quat[number] = np.roll(pose.rotation, 1)

    def _update_scene(self, poses: Mapping[str, Pose]) -> None:
        view = mujoco.MjvCamera()
        view.type = mujoco.mjtCamera.mjCAMERA_FIXED
        view.fixedcamid = self._model.camera(_CAMERA).id
        mujoco.mjv_updateScene(
            self._model,
            self._data,
            mujoco.MjvOption(),
            None,
            view,
            mujoco.mjtCatBit.mjCAT_ALL,
            self._scene,
        )
        if self._arm_radius:
            points = _center_line(list(poses.values()))
            for start, end in pairwise(points):
                self._draw_segment(start, end)

    def _draw_segment(self, start: np.ndarray, end: np.ndarray) -> None:
        geom = self._scene.geoms[self._scene.ngeom]
        kind = mujoco.mjtGeom.mjGEOM_CAPSULE
        mujoco.mjv_initGeom(
            geom, kind, np.zeros(3), np.zeros(3), np.zeros(9), _ARM_COLOR
        )
        mujoco.mjv_connector(geom, kind, self._arm_radius, start, end)
        self._scene.ngeom += 1


def look_at(position, target, up=(0.0, 0.0, 1.0)) -> Pose:
    """Return `T_world_camera` of a camera that looks at a point.

    Args:
        position: of the camera [m], three numbers.
        target: in the middle of the picture [m].
        up: direction that is up in the picture; not along the view.
    """
    forward = np.subtract(target, position)
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, up)
    right = right / np.linalg.norm(right)
    axes = np.stack([right, np.cross(forward, right), forward], axis=1)
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, axes.ravel())
    return Pose(position, np.roll(quaternion, -1))


def _open_context(width: int, height: int):
    """Open the first graphics context that this computer has.

    MuJoCo's own choice depends on an environment variable at its first import.
    """
    faults = []
    for name in _CONTEXTS.get(sys.platform, _OTHER_CONTEXTS):
        try:
            context = import_module(f"mujoco.{name}").GLContext(width, height)
            context.make_current()
        # drivers fail with exceptions of many kinds
        except Exception as error:
            faults.append(f"{name}: {error}")
        else:
            return context
    raise S2C2AError(
        f"pictures cannot be rendered on this computer ({'; '.join(faults)}); install "
        "EGL or OSMesa (on Debian: libegl1 or libosmesa6)"
    )


def _build_scene(layout: TagLayout, lens: Lens) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    _set_view(spec, lens)
    for name in layout.bodies:
        body = spec.worldbody.add_body(name=f"body {name}", mocap=True)
        for tag in layout.tags:
            if tag.body == name:
                _add_tag(spec, body, tag)
    camera = spec.worldbody.add_body(name=_CAMERA, mocap=True)
    camera.add_camera(name=_CAMERA, fovy=np.degrees(lens.field_height))
    return spec.compile()


def _set_view(spec: mujoco.MjSpec, lens: Lens) -> None:
    visual = spec.visual
    visual.global_.offwidth = lens.width
    visual.global_.offheight = lens.height
    # lens.picture averages the samples of a pixel
    visual.quality.offsamples = 0
    visual.map.znear = _NEAR
    visual.map.zfar = _FAR
    spec.stat.extent = 1.0
    # white paper has the gray value of its texture
    visual.headlight.ambient = (1.0, 1.0, 1.0)
    visual.headlight.diffuse = (0.0, 0.0, 0.0)
    visual.headlight.specular = (0.0, 0.0, 0.0)
    background = BACKGROUND / 255
    spec.add_texture(
        name="background",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT,
        rgb1=(background,) * 3,
        rgb2=(background,) * 3,
        width=8,
        height=48,
    )


def _add_tag(spec: mujoco.MjSpec, body, tag: Tag) -> None:
    """Add a textured square, and a board behind it that hides what is there."""
    half = SHEET * tag.size / 2
    name = f"tag {tag.id}"
    _add_material(spec, name, tag_texture(tag.id))
    _add_square(spec, name, half)
    # quaternions of MuJoCo are scalar first
    rotation = np.roll(tag.pose.rotation, 1)
    body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname=name,
        material=name,
        pos=tag.position,
        quat=rotation,
        # a flat mesh cannot collide
        contype=0,
        conaffinity=0,
    )
    behind = tag.pose @ Pose.measured((0, 0, -2 * _THICKNESS), (0, 0, 0, 1.0))
    gray = WHITE / 255
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=(half, half, _THICKNESS),
        pos=behind.position,
        quat=rotation,
        rgba=(gray, gray, gray, 1),
    )


def _add_material(spec: mujoco.MjSpec, name: str, texture: np.ndarray) -> None:
    printed = spec.add_texture(
        name=name,
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        width=texture.shape[1],
        height=texture.shape[0],
        nchannel=3,
    )
    printed.data = np.repeat(texture[..., None], 3, axis=-1).tobytes()
    textures = [""] * mujoco.mjtTextureRole.mjNTEXROLE
    textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name
    spec.add_material(name=name, textures=textures, specular=0.0, shininess=0.0)


def _add_square(spec: mujoco.MjSpec, name: str, half: float) -> None:
    """Add a square mesh; the picture's first row is up (+y), and +z is its front."""
    vertices = [(-half, half), (half, half), (half, -half), (-half, -half)]
    spec.add_mesh(
        name=name,
        uservert=np.ravel([(x, y, 0.0) for x, y in vertices]),
        userface=[0, 2, 1, 0, 3, 2],
        usertexcoord=[0, 0, 1, 0, 1, 1, 0, 1],
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
    )


def _center_line(poses: list[Pose]) -> np.ndarray:
    """Points of cubic curves through poses along their z axes [m], shape (points, 3)."""
    if len(poses) < 2:
        return np.empty((0, 3))
    shares = np.linspace(0, 1, _ARM_POINTS)[:, None]
    curves = []
    for start, end in pairwise(poses):
        length = np.linalg.norm(end.position - start.position)
        difference = end.position - start.position
        cubic = shares**2 * (3 - 2 * shares) * difference
        outgoing = shares * (1 - shares) ** 2 * length * start.z_axis
        incoming = shares**2 * (shares - 1) * length * end.z_axis
        curves.append(start.position + cubic + outgoing + incoming)
    return np.concatenate(curves)
