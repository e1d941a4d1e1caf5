"""The study of transfer between arms."""

import pytest

from s2c2a.errors import S2C2AError
from s2c2a.evaluation import Row
from s2c2a.robots.simulation.modes import first_mode
from s2c2a_experiments.transfer import (
    ANOTHER,
    FULL,
    PRIOR,
    SCRATCH,
    Method,
    Transfer,
    of_halves,
    ratios,
)


def test_every_arm_starts_from_the_networks_of_the_next(twin):
    pairs = Transfer(twin, arm_seeds=(0, 1, 2)).pairs()
    assert [pair.arm.name for pair in pairs] == [
        "twin_arm_50_0",
        "twin_arm_50_1",
        "twin_arm_50_2",
    ]
    assert [pair.other.name for pair in pairs] == [
        "twin_arm_50_1",
        "twin_arm_50_2",
        "twin_arm_50_0",
    ]


def test_six_half_modules_replace_three_whole_ones(twin):
    arm = of_halves(twin, 6)
    assert arm.length == pytest.approx(twin.length)
    assert sum(module.mass for module in arm.modules) == pytest.approx(
        sum(module.mass for module in twin.modules)
    )
    assert first_mode(arm)[0] > 0.3


def test_errors_are_divided_by_those_of_a_whole_recording():
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
            strategy=method,
            unit="cm",
            mean=mean,
            seeds=(0,),
            **where,
        )
        for method, mean in ((FULL, 0.5), (ANOTHER, 0.75))
    ]
    assert [(row.strategy, row.unit, row.mean) for row in ratios(rows)] == [
        (ANOTHER, "times", 1.5)
    ]


def test_a_single_arm_is_rejected(twin):
    with pytest.raises(S2C2AError, match="1 arms"):
        Transfer(twin, arm_seeds=(0,))


def test_every_sample_count_has_every_start_but_none_is_from_scratch_without_data(twin):
    methods = Transfer(twin, samples=(0, 100)).methods
    assert methods == [
        Method(FULL),
        Method(SCRATCH, 100),
        Method(ANOTHER, 0),
        Method(ANOTHER, 100),
        Method(PRIOR, 0),
        Method(PRIOR, 100),
    ]


def test_no_arms_of_a_prior_leave_the_prior_out(twin):
    starts = {method.start for method in Transfer(twin, prior=0).methods}
    assert starts == {FULL, SCRATCH, ANOTHER}


def test_samples_that_fill_no_episodes_are_rejected(twin):
    with pytest.raises(S2C2AError, match="multiples of 100"):
        Transfer(twin, samples=(150,))
