"""What a log does not show is named, and the last line says whether it can be used."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from s2c2a.arm.geometry import cable_matrix
from s2c2a.errors import S2C2AError
from s2c2a.kinematics import states_from_bends
from s2c2a.logs import import_logs, map_from_toml
from s2c2a.logs.model_fit import _standard_deviations
from s2c2a.logs.summary import summary, verdict

ANGLES = np.deg2rad([0.0, 120.0, 240.0])
BASE = np.array([0.1, -0.2, 0.3])  # m
DATA = Path(__file__).parents[2] / "examples" / "data" / "opencr_v4"
TURN = Rotation.from_euler("y", 90, degrees=True)


def log_map(unit, end="", arm=""):
    """Map of three drives and a tip."""
    drives = "".join(
        f'[[drives]]\ncommanded = "c{k}"\nunit = "{unit}"\n' for k in range(3)
    )
    return map_from_toml(
        '[rows]\nkind = "steps"\n[arm]\nname = "one"\nmodules = 1\ncontrol_rate = 5\n'
        f'cable_radius = 0.02\n{arm}{drives}[[ends]]\nposition = ["x", "y", "z"]\n'
        f'unit = "m"\n{end}'
    )


@pytest.fixture
def write(tmp_path):
    """Write a log of drives and bends; returns its path."""
    random = np.random.default_rng(2)

    def run(drives, bends, turn=TURN):
        states = states_from_bends(bends[:, None], np.array([0.15]))
        tips = turn.apply(np.asarray(states)[:, 0, :3]) + BASE
        tips += 2e-4 * random.normal(size=tips.shape)
        sizes = np.linalg.norm(bends, axis=1)
        vectors = np.stack([-bends[:, 1], bends[:, 0], 0 * sizes], axis=1)
        quaternions = (turn * Rotation.from_rotvec(vectors)).as_quat()
        table = np.hstack([drives, tips, np.roll(quaternions, 1, axis=1)])
        path = tmp_path / "log.csv"
        names = "c0,c1,c2,x,y,z,q0,q1,q2,q3"
        np.savetxt(path, table, "%.6f", ",", header=names, comments="")
        return path

    return run


@pytest.fixture
def one_moves(write):
    """Log of one chamber that moves, and of noise of the others [kPa]."""
    random = np.random.default_rng(1)
    moves = random.uniform(0.0, 8.0, 400)
    bends = np.stack([-0.2 * moves, np.zeros(400)], axis=1)

    def run(noise):
        pressures = 2.0 + noise * random.normal(size=(400, 3))
        pressures[:, 0] += moves
        return write(pressures, bends)

    return run


@pytest.mark.parametrize("noise", [0.0, 0.05, 0.1])
def test_drives_that_never_move_are_named(one_moves, noise):
    path = one_moves(noise)
    try:
        imported = import_logs([path], log_map("kPa", arm="length = 0.15\n"))
    except S2C2AError as error:
        text = str(error)
    else:
        text = "; ".join(imported.undetermined)
        text += verdict(imported)
    assert "'c1', 'c2'" in text


def test_a_deviation_keeps_what_the_log_does_not_excite():
    """Two parameters, of which rows show one; the prior of the other has deviation 2."""
    rows = np.stack([np.ones(100), np.zeros(100), np.zeros(100)], axis=1)
    prior = np.diag([1.0, 1.0, 0.5])
    jacobian = np.concatenate([rows, prior, np.zeros((1, 3))])
    residuals = np.concatenate([np.full(100, 1e-3), np.zeros(4)])
    std = _standard_deviations(residuals, jacobian, 100, 1)
    assert std[0] < 0.02
    assert std[1] == pytest.approx(np.hypot(1.0, 2.0))


@pytest.mark.parametrize("length", [0.15, 0.3])
def test_a_length_that_small_bends_do_not_show_is_no_silent_verdict(write, length):
    bends = np.random.default_rng(3).uniform(-0.1, 0.1, (400, 2))
    pulls = 20.0 * bends @ cable_matrix(ANGLES).T
    path = write(pulls, bends)
    text = log_map("mm", '[frame]\nalong = "x"\n', f"length = {length}\n")
    imported = import_logs([path], text)
    assert "not determined by this log: " in verdict(imported)
    assert verdict(imported).count("arm.length") == 1
    said = "\n".join(summary(imported))
    for factor in (0.8, 1.2):
        assert f"arm.length: {factor} times as long" in said
    assert "check this on the arm" in said


# places of the cables of opencr_v4, as `import` identifies them
PLACES = {
    "4": (0, 185.1),
    "3": (0, 308.8),
    "9": (0, 67.6),
    "5": (1, 213.6),
    "2": (1, 336.0),
    "8": (1, 94.1),
    "6": (2, 243.0),
    "1": (2, 3.1),
    "7": (2, 115.7),
}


def real_map(is_full=False, **changes):
    """Map of opencr_v4, with the places of its cables, and with other texts in it."""
    text = (DATA / "map.toml").read_text("utf-8")
    for name, (module, angle) in PLACES.items() if is_full else ():
        column = f'commanded = "servo_{name}_mm"\n'
        text = text.replace(column, f"{column}module = {module}\nangle_deg = {angle}\n")
    for old, new in changes.get("texts", {}).items():
        assert old in text
        text = text.replace(old, new)
    return map_from_toml(text)


def real_outcome(stated):
    try:
        imported = import_logs([DATA / "train.csv.gz"], stated)
    except S2C2AError as error:
        return str(error)
    return imported.diagnosis + imported.contradictions


@pytest.mark.slow
@pytest.mark.parametrize("is_full", [False, True])
@pytest.mark.parametrize("length", [0.15, 0.205, 0.3])
def test_a_wrong_length_is_not_taken_for_wrong_signs_or_modules(length, is_full):
    """The arm is 0.19 m long; reversed signs make up for it, and miss 20 to 50 %."""
    texts = {"control_rate": f"length = {length}\ncontrol_rate"}
    text = real_outcome(real_map(is_full, texts=texts))
    assert "correct arm.length" in text
    assert "does not tell which" not in text


@pytest.mark.slow
@pytest.mark.parametrize("is_full", [False, True])
def test_a_wrong_unit_of_the_tip_is_not_taken_for_wrong_signs_or_modules(is_full):
    texts = {'"tip_z"]\nunit = "mm"': '"tip_z"]\nunit = "m"'}
    text = real_outcome(real_map(is_full, texts=texts))
    assert 'contradicts the log: write unit = "mm" for the ends' in text


@pytest.mark.slow
@pytest.mark.parametrize("radius", [0.03, 0.1])
def test_a_wrong_radius_is_not_taken_for_a_wrong_unit_alone(radius):
    """The cables are 4.5 mm from the center line."""
    texts = {"control_rate": f"cable_radius = {radius}\ncontrol_rate"}
    text = real_outcome(real_map(True, texts=texts))
    assert "for the drives, or correct arm.cable_radius; in mm" in text
    assert "reverse" not in text


@pytest.mark.slow
def test_exchanged_columns_of_the_tip_are_named():
    texts = {'"tip_x", "tip_y"': '"tip_y", "tip_x"'}
    text = real_outcome(real_map(True, texts=texts))
    assert "contradicts the log: exchange the columns 'tip_y' and 'tip_x'; the" in text


@pytest.mark.slow
@pytest.mark.parametrize("is_full", [False, True])
def test_a_right_map_is_not_contradicted(is_full):
    assert real_outcome(real_map(is_full)) == ""


@pytest.mark.slow
def test_another_kind_of_rows_is_named():
    text = real_outcome(real_map(texts={'kind = "steps"': 'kind = "timed"'}))
    assert 'rows.kind = "steps"' in text


def changed(log_map, angles_deg, positive="releases"):
    """The map with drives of stated angles and effects."""
    drives = [
        each.model_copy(update={"angle_deg": angle, "positive": positive})
        for each, angle in zip(log_map.drives, angles_deg, strict=True)
    ]
    return log_map.model_copy(update={"drives": tuple(drives)})


FREE = log_map("mm", '[frame]\nalong = "z"\nx = "x"\n')


@pytest.mark.parametrize(
    ("angles_deg", "clause"),
    [
        ([0, 120, 240], ""),
        (ANGLES, "write angle_deg in degrees, not in radians"),
        ([0, -120, -240], "count angle_deg counterclockwise"),
        ([0, 240, 120], "exchange module, angle_deg of 'c1' and 'c2'"),
    ],
)
def test_angles_in_radians_and_exchanged_drives_are_named(write, angles_deg, clause):
    bends = np.random.default_rng(3).uniform(-0.8, 0.8, (400, 2))
    path = write(20.0 * bends @ cable_matrix(ANGLES).T, bends, Rotation.identity())
    try:
        text = import_logs([path], changed(FREE, angles_deg)).diagnosis
    except S2C2AError as error:  # no arm has such cables
        text = str(error)
    assert clause in text
    assert bool(text) == bool(clause)


@pytest.mark.parametrize("positive", ["pulls", "releases"])
def test_signs_of_all_drives_are_found_or_called_open(write, positive):
    bends = np.random.default_rng(3).uniform(-0.8, 0.8, (400, 2))
    path = write(20.0 * bends @ cable_matrix(ANGLES).T, bends, Rotation.identity())
    imported = import_logs([path], changed(FREE, [None] * 3, positive))
    found = "reverse `positive` of each drive" in imported.diagnosis
    assert found or "signs of all drives" in verdict(imported)


@pytest.mark.parametrize("gravity", ["", "gravity_direction = [0.0, 0.0, 1.0]\n"])
def test_a_direction_of_gravity_that_is_not_stated_is_open(write, gravity):
    bends = np.random.default_rng(3).uniform(-0.8, 0.8, (400, 2))
    path = write(20.0 * bends @ cable_matrix(ANGLES).T, bends)
    imported = import_logs([path], log_map("mm", arm=gravity))
    assert ("arm.gravity_direction" in verdict(imported)) == (not gravity)


def two_modules(order):
    """Map of six drives in free units and the tip; `order` numbers the modules."""
    drives = "".join(
        f'[[drives]]\ncommanded = "c{k}"\nunit = "free"\npositive = "pulls"\n'
        f"module = {order[k // 3]}\n"
        for k in range(6)
    )
    return map_from_toml(
        '[rows]\nkind = "steps"\n[arm]\nname = "two"\nmodules = 2\ncontrol_rate = 5\n'
        f'cable_radius = 0.02\n[frame]\nalong = "z"\nx = "x"\n{drives}'
        '[[ends]]\nmodule = 1\nposition = ["x", "y", "z"]\nunit = "m"\n'
    )


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_an_order_that_the_tip_alone_does_not_show_is_open(tmp_path, order):
    """Small bends with play, whose errors hide which modules bend further out."""
    random = np.random.default_rng(0)
    place = np.arange(400) / 8
    knots = random.uniform(-0.15, 0.15, (52, 2, 2))
    share = (place % 1)[:, None, None]
    wanted = (
        knots[place.astype(int)] * (1 - share) + knots[place.astype(int) + 1] * share
    )
    bend = wanted[0]
    bends = []
    for each in wanted:
        bend = np.clip(bend, each - 0.02, each + 0.02)
        bends.append(bend)
    tips = np.asarray(states_from_bends(np.array(bends), np.array([0.2, 0.15])))[
        :, 1, :3
    ]
    tips = tips + random.normal(0.0, 3e-4, tips.shape)
    pulls = -20.0 * np.einsum("ca,tma->tmc", cable_matrix(ANGLES), wanted)
    path = tmp_path / "log.csv"
    table = np.hstack([pulls.reshape(400, 6), tips])
    np.savetxt(path, table, "%.6f", ",", header="c0,c1,c2,c3,c4,c5,x,y,z", comments="")
    assert "order of modules" in verdict(import_logs([path], two_modules(order)))


@pytest.mark.parametrize(
    ("order", "clause"), [("wxyz", ""), ("xyzw", 'write order = "wxyz"')]
)
def test_the_other_order_of_a_quaternion_is_named(write, order, clause):
    bends = np.random.default_rng(3).uniform(-0.8, 0.8, (400, 2))
    pulls = 20.0 * bends @ cable_matrix(ANGLES).T
    path = write(pulls, bends, Rotation.identity())
    end = f'quaternion = ["q0", "q1", "q2", "q3"]\norder = "{order}"\n'
    imported = import_logs([path], log_map("mm", end))
    assert clause in imported.diagnosis
    assert bool(imported.diagnosis) == bool(clause)
    assert verdict(imported).startswith("not usable" if clause else "usable")


def test_vacuum_is_called_out_of_range(write):
    bends = np.random.default_rng(4).uniform(-0.8, 0.8, (400, 2))
    pressures = -10.0 * bends @ cable_matrix(ANGLES).T  # kPa
    path = write(pressures, bends, Rotation.identity())
    imported = import_logs([path], log_map("kPa", arm="length = 0.15\n"))
    text = "\n".join(summary(imported))
    assert "vacuum is not supported" in text
    assert "larger pressure_limit" not in text
    assert verdict(imported) == "not usable (pressures below zero are not supported)"


def test_steps_that_lie_between_rows_are_told(write):
    bends = np.random.default_rng(4).uniform(-0.8, 0.8, (400, 2))
    pressures = 20.0 - 10.0 * bends @ cable_matrix(ANGLES).T  # kPa
    path = write(pressures, bends, Rotation.identity())
    imported = import_logs([path], log_map("kPa", arm="length = 0.15\n"))
    assert imported.interpolated == ""
    assert "lengths: modules 150.0 +- 0.3 mm, in all 150.0 mm" in "\n".join(
        summary(imported)
    )
    sparse = replace(imported, segments=replace(imported.segments, rows=150))
    assert "400 steps from 150 rows: most lie between" in "\n".join(summary(sparse))
    assert "most steps lie between rows" in verdict(sparse)
