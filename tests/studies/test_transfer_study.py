"""What is tried of transfer."""

import pytest

from s2c2a.errors import S2C2AError
from s2c2a.evaluation import Row
from s2c2a.robots.simulation.modes import first_mode
from s2c2a.studies.transfer import ANOTHER, FULL, Transfer, of_halves, ratios


def test_every_arm_begins_from_another(twin):
    pairs = Transfer(twin, drawn=(0, 1, 2)).pairs()
    assert [one.name for one, _ in pairs] == [
        "twin_arm_50_0",
        "twin_arm_50_1",
        "twin_arm_50_2",
    ]
    assert [one.name for _, one in pairs] == [
        "twin_arm_50_1",
        "twin_arm_50_2",
        "twin_arm_50_0",
    ]


def test_six_halves_stand_where_three_wholes_do(twin):
    arm = of_halves(twin, 6)
    assert arm.length == pytest.approx(twin.length)
    assert sum(module.mass for module in arm.modules) == pytest.approx(
        sum(module.mass for module in twin.modules)
    )
    assert first_mode(arm)[0] > 0.3


def test_errors_are_held_against_those_of_a_whole_recording():
    where = {
        "experiment": "transfer",
        "task": "circle",
        "fidelity": "fast",
        "recipe": "best",
        "metric": "position",
    }
    rows = [
        Row(
            arm="mean of 2 arms at 0.5",
            strategy=way,
            unit="cm",
            mean=mean,
            seeds=(0,),
            **where,
        )
        for way, mean in ((FULL, 0.5), (ANOTHER, 0.75))
    ]
    assert [(row.strategy, row.unit, row.mean) for row in ratios(rows)] == [
        (ANOTHER, "times", 1.5)
    ]


def test_one_arm_alone_has_nothing_to_begin_from(twin):
    with pytest.raises(S2C2AError, match="1 arms"):
        Transfer(twin, drawn=(0,))
