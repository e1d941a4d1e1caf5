"""Drives whose numbers count from elsewhere, and what the map states of them."""

import numpy as np
import pytest

from s2c2a.arm.geometry import cable_matrix
from s2c2a.kinematics import states_from_bends
from s2c2a.logs import import_logs, map_from_toml
from s2c2a.logs.rests import possible_rests
from s2c2a.logs.take import LogTake

MAP = """
[rows]
kind = "steps"
[arm]
name = "servo"
modules = 1
control_rate = 10
length = 0.15
cable_radius = 0.012
[[drives]]
commanded = "a"
unit = "free"
{a}
cables = [{{ turn_deg = 0 }}, {{ turn_deg = 180, sign = -1 }}]
[[drives]]
commanded = "b"
unit = "free"
cables = [{{ turn_deg = 0 }}, {{ turn_deg = 180, sign = -1 }}]
[[ends]]
position = ["x", "y", "z"]
unit = "m"
"""


@pytest.fixture
def log(tmp_path):
    """Servos around 90 and 20 deg, each with a pair of cables of a one-module arm."""
    random = np.random.default_rng(1)
    bends = random.uniform(-0.8, 0.8, (300, 1, 2))
    tips = np.asarray(states_from_bends(bends, np.array([0.15])))[:, 0, :3]
    pulls = bends[:, 0] @ cable_matrix(np.deg2rad([0.0, 90.0])).T
    table = np.hstack([[90.0, 20.0] + 30.0 * pulls, tips])
    path = tmp_path / "log.csv"
    np.savetxt(path, table, "%.6f", ",", header="a,b,x,y,z", comments="")
    return path


def test_servos_count_from_where_the_arm_is_straight_even_if_they_pass_zero(log):
    imported = import_logs([log], map_from_toml(MAP.format(a="")))
    assert imported.residual < 1.5e-3
    np.testing.assert_allclose(imported.rig.rests, [90.0, 20.0], atol=3.0)
    angles = np.sort(imported.arm.modules[0].cable_angles_deg)
    np.testing.assert_allclose(np.diff(angles), 90.0, atol=3.0)


def take_of(values):
    rows = len(values)
    tips = np.zeros((rows, 1, 3))
    tips[:, 0, 0] = np.linspace(-0.05, 0.05, rows)
    tips[:, 0, 2] = 0.15 - 4.0 * tips[:, 0, 0] ** 2
    unknown = np.full_like(values, np.nan)
    return LogTake(
        np.arange(rows, dtype=float),
        values,
        unknown,
        tips,
        np.full((rows, 1, 3), np.nan),
        np.full(rows, ""),
    )


@pytest.mark.parametrize(
    ("low", "high", "a", "possible"),
    [
        (60.0, 120.0, "", [90.0]),
        (-120.0, -60.0, "", [-90.0]),
        (0.0, 180.0, "", [0.0, 90.0]),
        (60.0, 120.0, "offset = 0", [0.0]),  # stated
        (-30.0, 30.0, "", [0.0]),
    ],
)
def test_zero_is_a_rest_unless_it_is_far_from_all_values(low, high, a, possible):
    values = np.linspace(low, high, 201)[:, None] * np.ones(2)
    values[:, 1] -= (low + high) / 2
    log_map = map_from_toml(MAP.format(a=a) + '[frame]\nalong = "z"\n')
    rests = possible_rests([take_of(values)], log_map)
    np.testing.assert_allclose([rest[0] for rest in rests], possible, atol=2.0)
