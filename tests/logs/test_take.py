"""Takes: units, offsets, rotations, and joined files."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from s2c2a.logs import map_from_toml
from s2c2a.logs.errors import LogError
from s2c2a.logs.tables import Table
from s2c2a.logs.take import build_take, unit_vector

ARM = """[arm]
name = "a"
modules = 1
control_rate = 10
pulley_radius = 0.01
ticks_per_turn = 1000
"""
POSITION = '[[ends]]\nposition = ["x", "y", "z"]\nunit = "mm"\n'
TIP = {
    "x": np.array([1.0, 2.0]),
    "y": np.array([0.0, np.nan]),
    "z": np.array([200.0, 199.0]),
}


def make_map(drives='commanded = "m"\nunit = "mm"\n', ends=POSITION, more=""):
    head = f'[rows]\nkind = "steps"\n{more}{ARM}'
    return map_from_toml(f"{head}[[drives]]\n{drives}{ends}")


def take_of(log_map, columns):
    """Take of a log with these columns beside those of the tip."""
    columns = TIP | {"m": np.zeros(2)} | columns
    return build_take([Table("t", columns, {})], log_map)


@pytest.mark.parametrize(
    ("unit", "factor"),
    [
        ("m", 1),
        ("mm", 1e-3),
        ("cm", 1e-2),
        ("in", 0.0254),
        ("ft", 0.3048),
        ("turns", 0.02 * np.pi),
        ("ticks", 2e-5 * np.pi),
        ("deg", np.pi / 18000),
        ("rad", 0.01),
        ("N", 1),
    ],
)
def test_columns_are_converted_to_meters_or_newtons(unit, factor):
    log_map = make_map(f'commanded = "m"\nunit = "{unit}"\noffset = 100.0\n')
    take = take_of(log_map, {"m": np.array([100.0, 350.0])})
    np.testing.assert_allclose(take.commanded[:, 0], [0, 250 * factor])


QUATERNION = 'quaternion = ["a", "b", "c", "d"]\n'
EULER = 'euler = ["a", "b", "c"]\n'
TURN = Rotation.from_euler("XYZ", [20, -35, 50], degrees=True)


@pytest.mark.parametrize(
    ("keys", "values"),
    [
        (f'{QUATERNION}order = "xyzw"', TURN.as_quat()),
        (f'{QUATERNION}order = "wxyz"', np.roll(TURN.as_quat(), 1)),
        (f'{EULER}sequence = "XYZ"', TURN.as_euler("XYZ", degrees=True)),
        (f'{EULER}sequence = "zyx"', TURN.as_euler("zyx", degrees=True)),
        (f'{EULER}sequence = "zxz"\neuler_unit = "rad"', TURN.as_euler("zxz")),
    ],
)
@pytest.mark.parametrize("along", ["z", "-y"])
def test_every_rotation_format_gives_the_same_axis(keys, values, along):
    columns = dict(zip("abcd", np.outer(values, [1.0, np.nan]), strict=False))
    log_map = make_map(ends=f'{POSITION}{keys}\nalong = "{along}"\n')
    axes = take_of(log_map, columns).axes[:, 0]
    np.testing.assert_allclose(axes[0], TURN.apply(unit_vector(along)), atol=1e-12)
    assert np.isnan(axes[1]).all()


def test_ends_are_taken_relative_to_a_body_on_a_base_that_moves():
    random = np.random.default_rng(0)
    tips = random.normal(size=(4, 3))
    bases = random.normal(size=(4, 3))
    turns = Rotation.random(4, rng=0)
    columns = {"m": np.zeros(4)}
    for names, values in (
        ("xyz", 1e3 * (turns.apply(tips) + bases)),
        ("uvw", turns.apply([0.0, 0.0, 1.0])),
        ("XYZ", bases),
        ("ABCD", turns.as_quat()),
    ):
        columns |= dict(zip(names, values.T, strict=True))
    columns["A"][3] = np.nan
    log_map = make_map(
        ends=f"""{POSITION}axis = ["u", "v", "w"]
[frame.body]
position = ["X", "Y", "Z"]
unit = "m"
quaternion = ["A", "B", "C", "D"]
order = "xyzw"
"""
    )
    take = take_of(log_map, columns)
    np.testing.assert_allclose(take.positions[:3, 0], tips[:3], atol=1e-12)
    np.testing.assert_allclose(take.axes[:3, 0], [[0.0, 0.0, 1.0]] * 3, atol=1e-12)
    assert np.isnan([take.positions[3], take.axes[3]]).all()


def test_a_frozen_tip_is_found_beside_a_body_whose_noise_would_hide_it():
    random = np.random.default_rng(0)
    drives = np.cumsum(random.normal(size=400))
    tips = np.stack([drives, -drives, 200.0 + 0.1 * drives], axis=1)
    tips += random.normal(scale=0.1, size=tips.shape)
    tips[200:225] = tips[200]
    bases = random.normal(scale=0.1, size=(400, 3))
    columns = {
        "m": drives,
        **dict(zip("xyzXYZ", np.hstack([tips, bases]).T, strict=True)),
    }
    body = '[frame.body]\nposition = ["X", "Y", "Z"]\nunit = "mm"\n'
    take = take_of(make_map(ends=POSITION + body), columns)
    unknown = np.isnan(take.positions[:, 0]).all(axis=1)
    assert unknown[205:225].all()
    assert unknown.sum() <= 25


def test_a_body_with_other_coordinates_than_the_ends_is_refused():
    body = '[frame.body]\nposition = ["X", "Y"]\nunit = "mm"\n'
    with pytest.raises(LogError, match="as many coordinates"):
        make_map(ends=POSITION + body)


def test_vectors_are_normalized_and_missing_ones_stay_nan():
    values = np.array([[0.0, 0.0], [3.0, 0.0], [4.0, 0.0]])
    log_map = make_map(ends=f'{POSITION}axis = ["a", "b", "c"]\n')
    take = take_of(log_map, dict(zip("abc", values, strict=True)))
    np.testing.assert_allclose(take.axes[:, 0], [[0, 0.6, 0.8], [np.nan] * 3])


def joined(keys, values, seen_keys):
    """Take of commands and of positions in two files with keys."""
    commands = {"ID": np.array(keys), "m": np.array(values)}
    rows = np.arange(float(len(seen_keys)))
    seen = {"ID": np.array(seen_keys)} | dict.fromkeys("xyz", rows)
    tables = [Table("c", commands, {}), Table("s", seen, {})]
    return build_take(tables, make_map(more='[join]\nkey = "ID"\n'))


def test_files_are_joined_by_their_key_in_any_order():
    take = joined([3.0, 1.0, 2.0], [30.0, 10.0, 20.0], [2.0, 3.0, 9.0])
    np.testing.assert_allclose(take.commanded[:, 0], [0.020, 0.030])
    np.testing.assert_allclose(take.positions[:, 0, 0], [0, 0.001])


@pytest.mark.parametrize(
    ("keys", "message"), [([1.0, 2.0], "in common"), ([7.0, 7.0], "duplicate")]
)
def test_files_without_common_keys_or_with_duplicates_are_refused(keys, message):
    with pytest.raises(LogError, match=message):
        joined(keys, [0.0, 0.0], [7.0, 8.0])


COLUMNS = tuple(f"r{index}" for index in range(9))
MATRIX = POSITION + f"matrix = {list(COLUMNS)}\n"


def test_a_matrix_is_read_row_by_row_and_a_mirror_is_refused():
    turns = Rotation.from_euler("xyz", [[10, 20, 30], [50, 0, -20]], degrees=True)
    values = turns.as_matrix()
    rows = values.reshape(2, 9).T.copy()
    take = take_of(make_map(ends=MATRIX), dict(zip(COLUMNS, rows, strict=True)))
    np.testing.assert_allclose(take.axes[:, 0], values[:, :, 2], atol=1e-12)
    rows[:3, 1] *= -1
    with pytest.raises(LogError, match=r"'r0', ... is no rotation in 1 row,"):
        take_of(make_map(ends=MATRIX), dict(zip(COLUMNS, rows, strict=True)))


def test_scales_of_drives_and_ends_are_factors_and_missing_positions_stay_nan():
    ends = POSITION + "scale = 2.0\n"
    log_map = make_map('commanded = "m"\nunit = "mm"\nscale = 0.5\noffset = 4\n', ends)
    take = take_of(log_map, {"m": np.array([4, 8])})
    np.testing.assert_allclose(take.commanded[:, 0], [0, 0.002])
    np.testing.assert_allclose(
        take.positions[:, 0], [[0.002, 0, 0.4], [0.004, np.nan, 0.398]]
    )
    assert np.isnan(take.axes).all()
