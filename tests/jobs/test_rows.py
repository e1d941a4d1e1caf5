"""Result rows show the paper's numbers where they compare."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from s2c2a.arm import load_arm
from s2c2a.cli.console import print_results
from s2c2a.jobs.job import Conditions
from s2c2a.jobs.rows import Heading, printed
from s2c2a.robots import RobotFactory
from s2c2a.tasks.registry import TILTS

TWIN = load_arm("twin_arm")


def row_of(factory, arm=TWIN):
    """Row of a circle under these conditions."""
    job = SimpleNamespace(
        arm=arm, recipe=SimpleNamespace(name="best"), conditions=Conditions(factory)
    )
    heading = Heading.of("run", [SimpleNamespace(job=job, seed=0)])
    return heading.row("circle", "s2c2a", "position", "cm", [1.0])


def test_a_circle_of_the_twin_has_the_papers_number():
    assert row_of(RobotFactory.simulation()).paper_mean == 2.2


@pytest.mark.parametrize(
    "factory",
    [
        RobotFactory.simulation(payload=0.05),
        RobotFactory.simulation(events="6 payload 0.05"),
        RobotFactory("dynamixel"),
    ],
)
def test_disturbed_and_real_arms_have_none(factory):
    assert row_of(factory).paper_mean is None


@pytest.mark.parametrize(("name", "count"), [("twin_arm", 1), ("mine", 0)])
def test_the_column_of_the_paper_appears_with_its_numbers_only(name, count, capsys):
    row = row_of(RobotFactory.simulation(), TWIN.model_copy(update={"name": name}))
    print_results("circle", [row], [], Path("runs"))
    assert capsys.readouterr().out.count("paper") == count


def test_every_tilt_task_has_the_papers_numbers():
    for task in TILTS:
        for strategy in ("s2c2a", "pcc"):
            assert printed(task, TWIN, strategy, "tilt"), task
    assert printed("tilt-40", TWIN, "pcc", "position") == {
        "paper_mean": 3.3,
        "paper_std": 1.0,
    }
