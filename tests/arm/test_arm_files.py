import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from s2c2a.arm import (
    ArmSpec,
    Cable,
    Mismatch,
    Module,
    Motor,
    arm_from_toml,
    arm_to_toml,
    load_arm,
    preset_names,
    randomized_arm,
    save_arm,
)
from s2c2a.arm.spec import largest_gap_deg
from s2c2a.errors import ArmError
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.strategies import shipped_networks

TWIN = load_arm("twin_arm")


def between(low, high):
    return st.floats(low, high, allow_nan=False)


def maybe(strategy):
    return st.none() | strategy


def several(low, high, count):
    return st.lists(between(low, high), min_size=count, max_size=count)


def each(low, high, count):
    """One number, or one for each of so many cables."""
    return between(low, high) | several(low, high, count)


@st.composite
def modules(draw, cables: int, tension: bool):
    layouts = several(-360, 720, cables).filter(lambda a: largest_gap_deg(a) < 179)
    slips = {"backlash": each(0, 0.02, cables), "creep": between(0, 0.9)}
    limits = between(0.05, 500)
    cable = st.builds(
        Cable,
        stiffness=between(50, 1e6),
        friction=between(0, 1),
        **({} if tension else slips),
    )
    mismatch = st.builds(
        Mismatch,
        coupling=maybe(between(0, 1)),
        radius_errors=each(-0.5, 0.5, cables),
    )
    return Module(
        length=draw(between(0.3, 2)),
        cable_radius=draw(between(0.0015, 0.3)),
        cable_angles_deg=tuple(draw(layouts)),
        mass=draw(between(0.0005, 10)),
        bending_stiffness=draw(between(0.0005, 50)),
        torsional_stiffness=draw(maybe(between(0.0005, 50))),
        bend_limit_deg=draw(between(1, 150)),
        pretension=draw(between(0, 500)),
        tension_range=draw(limits if tension else maybe(limits)),
        mismatch=draw(mismatch),
        cable=draw(cable),
    )


@st.composite
def arms(draw):
    tension, cables = draw(st.booleans()), draw(st.integers(3, 8))
    speeds = maybe(between(0.001, 5000 if tension else 5))
    row = tuple(draw(st.lists(modules(cables, tension), min_size=1, max_size=4)))
    coupling = several(-1, 1, len(row)).map(lambda numbers: (numbers,) * len(row))
    turns = st.integers(16, 2**24)
    directions = [(0, 0, -1), (0, 0, 1), (0, 0, 0), (0.6, 0.0, -0.8)]
    return ArmSpec(
        name=draw(st.from_regex(r"\A[A-Za-z0-9][A-Za-z0-9_-]{0,63}\Z")),
        description=draw(st.text(max_size=40)),
        actuation="tension" if tension else "displacement",
        sensing=draw(st.sampled_from(["encoders", "true"])),
        coupled_cables=draw(st.booleans()),
        gravity_direction=draw(st.sampled_from(directions)),
        control_rate=draw(between(0.01, 1000)),
        motor=draw(st.builds(Motor, speed_limit=speeds, ticks_per_turn=turns)),
        sensing_coupling=draw(maybe(coupling)),
        modules=row,
    )


@pytest.mark.parametrize("name", preset_names())
def test_a_preset_written_and_read_again_is_the_same_arm(name):
    arm = load_arm(name)
    assert arm_from_toml(arm_to_toml(arm)) == arm


@settings(deadline=None, max_examples=60)
@given(arms())
def test_any_arm_written_and_read_again_is_the_same_arm(arm):
    assert arm_from_toml(arm_to_toml(arm)) == arm


def test_a_file_is_not_overwritten_unasked(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text("precious")
    with pytest.raises(ArmError, match=r"mine\.toml exists"):
        save_arm(load_arm("twin_arm"), path)
    assert path.read_text() == "precious"


def test_an_unwritable_path_is_named_and_missing_folders_are_created(tmp_path):
    (tmp_path / "file").write_text("no folder")
    with pytest.raises(ArmError, match=r"cannot write .*mine\.toml"):
        save_arm(load_arm("twin_arm"), tmp_path / "file" / "mine.toml")
    save_arm(load_arm("twin_arm"), tmp_path / "new" / "mine.toml")
    assert load_arm(tmp_path / "new" / "mine.toml") == load_arm("twin_arm")


@pytest.mark.parametrize(
    ("bend_deg", "step_deg", "rate", "named"),
    [
        (1.2, 4.0, 10.0, ["bend_limit_deg is 1.2; limits are in degrees: write 68.8"]),
        (4.0, 4.0, 10.0, []),
        (
            47.0,
            0.3,
            10.0,
            [],
        ),  # slow arms are as slow as steps in radians would make them
        (47.0, 0.07, 10.0, []),
        (1.0, 0.07, 10.0, ["bend_limit_deg is 1; limits are in degrees: write 57.3"]),
        (47.0, 9.0, 0.1, []),
    ],
)
def test_a_bend_limit_in_radians_is_warned_of(
    tmp_path, bend_deg, step_deg, rate, named
):
    arm = randomized_arm(load_arm("twin_arm"), 2, 1.0)
    modules = tuple(
        module.model_copy(update={"bend_limit_deg": bend_deg}) for module in arm.modules
    )
    limits = {"modules": modules, "step_limit_deg": step_deg, "control_rate": rate}
    save_arm(arm.model_copy(update=limits), tmp_path / "mine.toml")
    with warnings.catch_warnings(record=True) as said:
        load_arm(tmp_path / "mine.toml")
    path = tmp_path / "mine.toml"
    expected = [f"{path}: {text} if it is in radians, else leave it" for text in named]
    assert [str(each.message) for each in said] == expected


def test_a_missing_file_lists_the_presets(tmp_path):
    with pytest.raises(ArmError, match=r"nowhere\.toml") as caught:
        load_arm(tmp_path / "nowhere.toml")
    assert all(name in str(caught.value) for name in preset_names())


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b'name = "a"\nactuation = \n', r"not valid TOML: .*line 2"),
        (b"\xff\xfe\x00\x80", "cannot be read as UTF-8"),
    ],
)
def test_broken_toml_and_what_is_no_text_are_named_with_the_file(
    tmp_path, content, told
):
    path = tmp_path / "broken.toml"
    path.write_bytes(content)
    with pytest.raises(ArmError, match=rf"broken\.toml: {told}"):
        load_arm(path)


def test_an_empty_file_says_what_is_missing():
    with pytest.raises(ArmError) as caught:
        arm_from_toml("", source="empty.toml")
    for key in ("name", "actuation", "modules"):
        assert f"{key}: this key is missing" in str(caught.value)


def test_arms_that_differ_in_name_only_have_the_same_mechanics():
    arm = load_arm("twin_arm")
    renamed = arm.model_copy(update={"name": "other", "description": "copied"})
    assert renamed != arm
    assert renamed.differences(arm) == []


@pytest.mark.parametrize(
    ("part", "update", "words"),
    [
        (
            TWIN,
            {"step_limit_deg": -2.0},
            r"step_limit_deg: write 0.01 or more \(got -2",
        ),
        (TWIN, {"step_limit": 2.0}, "did you mean step_limit_deg?"),
        (TWIN.modules[0], {"length": -1}, r"length: write 0.0005 or more \(got -1\)"),
        (TWIN.modules[0].cable, {"creep": 2}, "creep: write 0.9 or less"),
        (TWIN.modules[0].mismatch, {"seed": "one"}, "no such key"),
        (TWIN.motor, {"ticks_per_turn": 0.5}, "whole number"),
        (TWIN.sensors, {"camera": 3}, "write a table"),
    ],
)
def test_a_copy_of_a_part_has_values_that_a_file_may_have(part, update, words):
    with pytest.raises(ArmError, match=words) as caught:
        part.model_copy(update=update)
    assert f"{type(part).__name__}: 1 fault in the" in str(caught.value)
    assert "pydantic" not in str(caught.value)
    assert part.model_copy() == part


def test_a_deep_copy_shares_no_part():
    shallow, deep = (TWIN.model_copy(deep=each) for each in (False, True))
    assert shallow.modules[0] is TWIN.modules[0]
    assert deep == TWIN
    assert deep.modules[0] is not TWIN.modules[0]


def test_differences_lists_the_keys_that_differ():
    arm = load_arm("twin_arm")
    other = arm.model_copy(update={"control_rate": 20.0, "modules": arm.modules[:2]})
    rate, module = arm.differences(other)
    assert rate == f"control_rate {arm.control_rate}, now 20.0"
    assert module.startswith("modules.2 {'length': 0.2")
    assert module.endswith("now None")


def test_differences_name_the_key_of_a_module_and_both_values():
    arm = load_arm("twin_arm")
    last = arm.modules[-1]
    heavier = last.model_copy(update={"mass": 2.0 * last.mass})
    other = arm.model_copy(update={"modules": (*arm.modules[:-1], heavier)})
    text = f"modules.2.mass {last.mass}, now {2.0 * last.mass}"
    assert arm.differences(other) == [text]


def test_radii_of_bodies_are_no_mechanics():
    """They keep clear of obstacles alone: forces, inertia and models do not know them."""
    arm = load_arm("twin_arm")
    changes = {"radius": 0.06}
    modules = tuple(module.model_copy(update=changes) for module in arm.modules)
    wider = arm.model_copy(update={"modules": modules})
    assert not arm.differences(wider)
    commands = np.zeros((5, arm.module_count, arm.cable_count))
    commands[:, 1, 0] = -0.004
    states = []
    for each in (arm, wider):
        with SimulatedRobot(each) as robot:
            for command in commands:
                robot.send(command)
                robot.advance(arm.control_period)
            states.append(robot.read()["states"])
    np.testing.assert_array_equal(*states)
    networks = shipped_networks(wider)
    assert networks.arm is wider
