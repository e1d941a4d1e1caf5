"""`s2c2a reach`: what it says about targets and paths, its figure and its errors."""

import warnings
from dataclasses import replace
from pathlib import Path

import pytest

from s2c2a.arm import randomized_arm
from s2c2a.cli.main import main
from s2c2a.cli.reach import arm_of
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.strategies import save_networks

FIXTURES = Path(__file__).parents[1] / "fixtures"
PATH = """time,x,y,z
1,0.2,0,0.5
3,0.2,0.1,0.5
5,0.2,0.6,0.5
7,0.2,0.1,0.5
"""


def said(capsys, line: str) -> str:
    """What a command line prints, on one line."""
    main(["reach", *line.split()])
    return " ".join(capsys.readouterr().out.split())


@pytest.fixture
def path(tmp_path):
    file = tmp_path / "path.csv"
    file.write_text(PATH, encoding="utf-8")
    return file


@pytest.mark.slow
def test_a_target_within_reach_is_reached_by_a_shape(capsys):
    printed = said(capsys, "--target 0.2 0.1 0.5")
    assert "without --weights, modules bend as arcs of a circle" in printed
    assert "miss by centimeters what arcs reach" in printed
    assert "the tip reaches (0.200, 0.100, 0.500) m: it misses by 0.0" in printed
    assert "of 8 starts of the search end as near" in printed
    assert "bend deg" in printed
    assert "clearance" not in printed


def test_a_target_out_of_reach_has_a_nearest_point(capsys):
    printed = said(capsys, "--target 0 0 0.7")
    assert "the tip does not reach (0.000, 0.000, 0.700) m" in printed
    assert "it misses by 10.0" in printed
    assert "nearest point of the tip: (0.000, 0.000, 0.600) m" in printed


def test_the_end_of_an_inner_module_has_a_target_with_an_axis(capsys):
    printed = said(capsys, "--target 0 0 0.4 --axis 0 0 2 --module 2")
    assert "the end of module 2 reaches (0.000, 0.000, 0.400) m" in printed
    assert "cm and 0.0 deg" in printed


def test_an_obstacle_has_a_clearance(capsys):
    line = "--target 0 0 0.6 --obstacle 0 0 0.3 0.08 --obstacle 0.3 0 0.3 0.02"
    printed = said(capsys, line)
    assert "the tip does not reach" in printed
    assert "clearance of the body from the obstacles" in printed


def test_a_path_has_its_parts_out_of_reach_in_a_table(path, capsys):
    printed = said(capsys, f"--csv {path}")
    assert "Out of reach" in printed
    assert "of 70 moments are out of reach, by up to " in printed
    assert "misses by deg" not in printed


def test_a_path_within_reach_is_said_in_a_sentence(tmp_path, capsys):
    file = tmp_path / "still.csv"
    file.write_text("time,x,y,z\n1,0,0,0.6\n", encoding="utf-8")
    assert "all of 10 moments are within reach" in said(capsys, f"--csv {file}")


@pytest.mark.slow
@pytest.mark.parametrize("what", ["--target 0 0 0.7", "--csv"])
def test_a_map_is_drawn(what, path, tmp_path, capsys):
    figure = tmp_path / "map.png"
    given = f"{what} {path}" if what == "--csv" else what
    printed = said(capsys, f"{given} --obstacle 0.2 0 0.3 0.05 --map {figure}")
    assert f"figure: {figure}" in printed
    assert figure.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("", "none was given"),
        ("--target 0 0 0.5 --csv path.csv", "both were given"),
        ("--csv missing.csv", "no waypoints at missing.csv"),
        ("--target 200 100 500", "write lengths in meters"),
        ("--target nan 0 0.5", "three finite numbers"),
        ("--target 0.1 0.2", "must be three finite numbers of at most 1e+06, got (0.1"),
        ("--target 0 0 0.5 0.1", "the target position must be three finite numbers"),
        ("--target 0 0 0.5 --axis 0 1", "the target axis must be three finite numbers"),
        ("--target 0 0 0.5 --axis 0 0 0", "the target axis is zero"),
        ("--target 0 0 0.5 --module 4", "'twin_arm' has 3, from 1"),
        ("--target 0 0 0.5 --module 0", "--module 0 does not exist"),
        ("--target 0 0 0.5 --obstacle 0 0 0.2 0", "must be positive"),
        ("--target 0 0 0.5 --map map.txt", "ends in .png"),
        ("--target 0 0 0.5 --weights missing.safetensors", "no strategy at"),
        ("--target 0 0 0.5 --weights shipped --payload-g -5", "is no mass"),
    ],
)
def test_bad_input_is_refused_before_the_search(
    line, message, path, monkeypatch, refusal
):
    monkeypatch.chdir(path.parent)
    assert message in refusal("reach", *line.split())


@pytest.mark.parametrize("seed", [1, 6])
def test_a_payload_in_grams_is_warned_of(seed, twin):
    arm = randomized_arm(twin, seed, 1.0)
    for payload in (0.5 * arm.mass, 20.0):
        with warnings.catch_warnings(record=True) as said:
            SimulatedRobot(arm, payload=payload)
        assert len(said) == (payload == 20.0)
    assert "check its unit" in str(said[0].message)


def test_the_arm_is_that_of_the_weights_unless_another_is_given(
    tiny_networks, twin, tmp_path
):
    weights = tmp_path / "other.safetensors"
    other = randomized_arm(twin, 2, 1.0)
    save_networks(replace(tiny_networks, arm=other), weights)
    assert arm_of(None, weights) == other
    assert arm_of("spiral_arm", weights).name == "spiral_arm"
    assert {arm_of(None, each).name for each in (None, Path("shipped"))} == {"twin_arm"}


def test_a_model_without_payloads_is_named(refusal):
    weights = FIXTURES / "paper.safetensors"
    line = f"--target 0 0 0.5 --weights {weights} --payload-g 50"
    assert "does not depend on payloads" in refusal("reach", *line.split())
