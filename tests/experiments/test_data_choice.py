"""The choice of training data: paired errors, and when another kind is chosen."""

from dataclasses import replace

import pytest

from s2c2a.evaluation import Row
from s2c2a_experiments.data_choice import DataStudy, choice, data_rows, ratio_rows

KINDS = "coverage", "mixed"
ROW = Row("data", "circle", "a", "fast", "coverage", "best", "position", "cm", 1.0)


def rows(*errors: float) -> list[Row]:
    """Rows of arms that err by 1 cm with `coverage`, and by these with `mixed`."""
    scored = []
    for arm, error in zip("abcdefgh", errors, strict=False):
        scored += [replace(ROW, arm=arm), replace(ROW, arm=arm, task="square")]
        other = replace(ROW, arm=arm, strategy="mixed")
        scored += [replace(other, mean=error), replace(other, task="square", mean=1.0)]
    return scored


def test_errors_are_compared_on_the_same_arm_and_task():
    ratio, bound = ratio_rows(rows(0.25, 4.0), KINDS)
    assert ratio.mean == pytest.approx(1.0)
    assert bound.mean == pytest.approx(4.0)  # twice the standard error of log 2


@pytest.mark.parametrize(
    ("errors", "chosen"),
    [
        ((0.8, 0.85, 0.9), "mixed"),
        ((0.4, 0.5, 2.0), "coverage"),  # better on average, by chance
        ((1.2, 1.3), "coverage"),
        ((0.5,), "coverage"),  # one arm shows nothing
    ],
)
def test_only_a_kind_that_is_surely_better_is_chosen(errors, chosen):
    assert choice([*ratio_rows(rows(*errors), KINDS)], KINDS) == chosen


def test_every_arm_is_trained_with_every_kind_and_seed(twin, asked):
    study = DataStudy((twin,), KINDS, ("circle",), (0, 1))
    jobs = asked(data_rows, study)
    assert [(job.recipe.babbling, job.seed) for job in jobs] == [
        ("coverage", 0),
        ("coverage", 1),
        ("mixed", 0),
        ("mixed", 1),
    ]
