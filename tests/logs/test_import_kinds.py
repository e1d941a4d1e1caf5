"""Logs of arms with other cables than three or four on every module."""

from dataclasses import dataclass

import numpy as np
import pytest

from s2c2a.arm.geometry import cable_matrix
from s2c2a.kinematics import states_from_bends
from s2c2a.logs import import_logs, map_from_toml
from s2c2a.logs.errors import LogError
from s2c2a.logs.priors import stated_angles, with_stated_angles

from marks import slow_after

ROWS = 200
LENGTHS = np.array([0.1, 0.12])
RADIUS = 0.012
HEAD = """
[rows]
kind = "steps"
[arm]
name = "found"
modules = 2
control_rate = 10
length = 0.22
coupled_cables = false
cable_radius = 0.012
"""
END = '[[ends]]\nmodule = {}\nunit = "m"\nposition = {}\n'


@dataclass(frozen=True)
class Kind:
    """Angles of cables or chambers by module, and the drives' unit."""

    angles_deg: tuple[tuple[float, ...], ...]
    unit: str = "m"
    stated: bool = True

    @property
    def column(self) -> str:
        """Pressures are measured, displacements are commanded."""
        return "measured" if self.unit == "kPa" else "commanded"

    @property
    def map(self) -> str:
        """Table of every drive."""
        return "".join(
            f'[[drives]]\n{self.column} = "c{module}{cable}"\nunit = "{self.unit}"\n'
            + (f"module = {module}\n" if self.stated else "")
            + ('positive = "releases"\n' if self.unit == "m" else "")
            for module, angles in enumerate(self.angles_deg)
            for cable in range(len(angles))
        )

    def columns(self, bends: np.ndarray) -> dict[str, np.ndarray]:
        """Displacements, or pressures that bend as much."""
        columns = {}
        for module, angles in enumerate(self.angles_deg):
            values = bends[:, module] @ cable_matrix(np.deg2rad(angles)).T
            if self.unit == "kPa":
                values = 40.0 * (values - values.min(axis=1, keepdims=True))
                values -= 0.05  # error of the sensor's zero
            else:
                values = RADIUS * values
            columns |= {f"c{module}{k}": value for k, value in enumerate(values.T)}
        return columns


MIXED = Kind(((10.0, 130.0, 250.0), (45.0, 135.0, 225.0, 315.0)))
PLANAR = Kind(((0.0, 180.0), (0.0, 180.0)), stated=False)
PASSIVE = Kind(((), (0.0, 120.0, 240.0)))
PRESSURE = Kind(((30.0, 150.0, 270.0), (90.0, 210.0, 330.0)), "kPa")


def bends_of(kind: Kind) -> np.ndarray:
    """Random bends that the cables can cause [rad]."""
    bends = np.random.default_rng(0).uniform(-0.6, 0.6, (ROWS, 2, 2))
    for module, angles in enumerate(kind.angles_deg):
        bends[:, module] *= len(angles) > 0
        if len(angles) == 2:
            bends[:, module, 1] = 0.0
    return bends


def both_ends(states):
    return {
        f"{axis}{module}": states[:, module, k]
        for module in range(2)
        for k, axis in enumerate("xyz")
    }


def import_kind(folder, kind, ends, coordinates=both_ends, head=HEAD):
    bends = bends_of(kind)
    states = np.asarray(states_from_bends(bends, LENGTHS))
    columns = kind.columns(bends)
    table = columns | coordinates(states)
    path = folder / "log.csv"
    rows = np.stack(list(table.values()), axis=1)
    np.savetxt(path, rows, "%.9g", ",", header=",".join(table), comments="")
    return import_logs([path], map_from_toml(head + kind.map + ends))


IMAGE = END.format(1, ["u", "v"]) + 'euler = ["angle"]\nsequence = "z"\n'
SPATIAL = "".join(END.format(m, [f"{axis}{m}" for axis in "xyz"]) for m in range(2))


@pytest.mark.parametrize("kind", slow_after(1, [MIXED, PASSIVE, PRESSURE]))
def test_angles_of_all_cables_are_identified(tmp_path, kind):
    frame = '[frame]\nalong = "z"\nx = "x"\nbase = [0, 0, 0]\n'
    imported = import_kind(tmp_path, kind, SPATIAL + frame)
    assert imported.residual < 1e-3
    actuation = "pressure" if kind is PRESSURE else "displacement"
    assert imported.arm.actuation == actuation
    for module, angles in zip(imported.arm.modules, kind.angles_deg, strict=True):
        found = np.sort((np.array(module.cable_angles_deg) + 5.0) % 360.0) - 5.0
        np.testing.assert_allclose(found, angles, atol=2.0)


@pytest.mark.slow
def test_pressures_bend_the_identified_arm_as_in_the_log(tmp_path):
    head = HEAD.replace("0.012", "0.012\nbending_stiffness = 0.02")
    imported = import_kind(tmp_path, PRESSURE, SPATIAL, head=head)
    assert min(episode["actions"].min() for episode in imported.episodes) == 0.0
    arm = imported.arm
    # 40 kPa a radian at a chamber's angle, and half of it at the two others
    for module, length in zip(arm.modules, LENGTHS, strict=True):
        area = 0.02 / length / (RADIUS * 60e3)
        assert module.chamber_area == pytest.approx(area, rel=0.05)
        assert module.pressure_limit >= 48e3


@pytest.mark.slow
def test_an_image_shows_a_planar_arm(tmp_path):
    def in_image(states):  # x to the right, y down
        tip = states[:, 1]
        angle = np.rad2deg(np.arctan2(-tip[:, 5], tip[:, 3]))
        return {"u": 0.3 + tip[:, 0], "v": 0.4 - tip[:, 2], "angle": angle}

    imported = import_kind(tmp_path, PLANAR, IMAGE + 'along = "x"', in_image)
    assert imported.residual < 1e-3
    np.testing.assert_allclose(imported.rig.base, [0.3, 0.4, 0.0], atol=2e-3)
    np.testing.assert_allclose(imported.rig.axes[2], [0.0, -1.0, 0.0], atol=0.02)
    assert all(module.is_planar for module in imported.arm.modules)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('unit = "kPa"', 'unit = "kPa"\npositive = "pulls"'), "pushes"),
        (('unit = "kPa"', 'unit = "N"'), "and no two of them"),
    ],
)
def test_pressures_push_and_all_drives_are_alike(change, message):
    text = (HEAD + PRESSURE.map + SPATIAL).replace(*change, 1)
    with pytest.raises(LogError, match=message):
        map_from_toml(text)


def test_an_angle_in_a_plane_needs_the_direction_along_the_arm():
    with pytest.raises(LogError, match="state along"):
        map_from_toml(HEAD + PLANAR.map + IMAGE)


def test_stated_angles_count_from_an_unknown_x():
    drives = MIXED.map
    for cable, angle in enumerate((0, 120)):
        name = f'"c0{cable}"\n'
        drives = drives.replace(name, f"{name}angle_deg = {angle}\n")
    log_map = map_from_toml(HEAD + drives + SPATIAL)
    estimated = np.deg2rad([90.0, 200.0, 330.0, 0.0, 90.0, 180.0, 270.0])
    stated = stated_angles(log_map)
    angles = np.rad2deg(with_stated_angles(estimated, stated, log_map))
    np.testing.assert_allclose(angles[:3], [90.0, 210.0, 330.0], atol=1e-6)
    with_x = map_from_toml(HEAD + drives + SPATIAL + '[frame]\nx = "x"\n')
    angles = np.rad2deg(with_stated_angles(estimated, stated, with_x))
    np.testing.assert_allclose(angles[:3], [0.0, 120.0, 330.0], atol=1e-6)
