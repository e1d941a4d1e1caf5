"""What a line of the benchmark says."""

import json

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.bench.lines import (
    Failed,
    held_to_limits,
    line_from_json,
    line_to_json,
    options_from_json,
    options_to_json,
)
from s2c2a.bench.measurement import Growth, Limit, Measurement, Skipped, growing, memory, ratio, speed, timing
from s2c2a.bench.options import BenchOptions
from s2c2a.bench.table import table_rows, value_in
from s2c2a.errors import S2C2AError


@pytest.mark.parametrize(
    ("limit", "median", "tail", "kept"),
    [
        (Limit(2.0), 2.0, 9.0, True),
        (Limit(2.0), 2.1, None, False),
        (Limit(2.0, 4.0), 1.0, 4.0, True),
        (Limit(2.0, 4.0), 1.0, 4.1, False),
        (Limit(2.0, 4.0), 1.0, None, True),
        (Limit(15.0, at_least=True), 15.0, 1.0, True),
        (Limit(15.0, at_least=True), 14.9, None, False),
    ],
)
def test_a_limit_is_kept_or_not(limit, median, tail, kept):
    assert Measurement("plan", "s", median, tail, limit=limit).kept is kept


def test_without_a_limit_there_is_no_verdict():
    assert Measurement("plan", "s", 1.0).kept is None


def test_a_timing_is_the_median_and_the_99th_percentile():
    line = timing("plan", np.arange(101.0))
    assert (line.median, line.percentile_99, line.repeats, line.unit) == (50.0, 99.0, 101, "s")
    assert timing("once", np.array([3.0])).percentile_99 is None


def test_the_slow_end_of_a_speed_is_below_its_median():
    line = speed("fast", np.array([0.001] * 99 + [0.01] * 2))
    assert line.median == pytest.approx(1000.0)
    assert line.percentile_99 == pytest.approx(100.0)


def test_a_ratio_is_that_of_the_medians_and_not_the_median_of_ratios():
    assert ratio("", np.array([1.0, 4.0, 10.0]), np.array([1.0, 2.0, 9.0])).median == 2.0


def test_memory_of_one_time_has_no_percentile():
    assert memory("", [7.0]).percentile_99 is None
    assert memory("", [7.0, 9.0]).median == 8.0


def test_the_exponent_of_a_power_law_is_found_and_sizes_of_zero_are_left_out():
    sizes = (0, 1, 2, 4, 8)
    growth = Growth("obstacles", "plan", sizes, [9.0, *(3.0 * np.array(sizes[1:]) ** 1.5)], [0.0] * 5, 1)
    assert growth.slope == pytest.approx(1.5)
    assert growth.steepest == pytest.approx(1.5)


def test_the_steepest_part_of_a_growth_is_told():
    assert Growth("", "", (1, 2, 4), (1.0, 1.0, 4.0), (1.0, 1.0, 4.0), 1).steepest == pytest.approx(2.0)


def test_growing_gives_the_growth_and_its_exponent_with_the_limit():
    growth, exponent = growing("modules", "plan", (1, 10), [np.full(3, 1.0), np.full(3, 10.0)], Limit(1.0 + 1e-9))
    assert growth.repeats == 3
    assert exponent.median == pytest.approx(1.0)
    assert exponent.kept is True


@pytest.mark.parametrize(
    "line",
    [
        Measurement("tick", "s", 1e-3, 2e-3, 5, Limit(2e-3, 4e-3), error=1e-3, note="on a quiet machine"),
        Measurement("tick", "s", 1e-3),
        Growth("modules", "plan", [1, 2], [1.0, 2.0], [1.0, 2.0], 7),
        Skipped("PyTorch", "not installed"),
        Failed("plan", "no arm"),
    ],
)
def test_lines_come_back_from_json_as_they_were(line):
    text = json.dumps(line_to_json(line), allow_nan=False)
    assert line_from_json(json.loads(text)) == line


def test_options_come_back_from_json_as_they_were(twin):
    options = BenchOptions(twin, seed=3, repeats=7, whole=True)
    assert options_from_json(json.loads(json.dumps(options_to_json(options)))) == options


def test_limits_are_for_the_twin_alone(twin):
    line = Measurement("tick", "s", 1.0, limit=Limit(2.0))
    assert held_to_limits(line, twin, twin) == line
    assert held_to_limits(line, load_arm("simulated_arm"), twin).limit is None


@pytest.mark.parametrize("changed", [{"repeats": 0}, {"ticks": 0}, {"memory_ticks": -1}, {"seed": -1}])
def test_options_that_measure_nothing_are_refused(twin, changed):
    with pytest.raises(S2C2AError, match=next(iter(changed)).replace("_", ".")):
        BenchOptions(twin, **changed)


def test_a_quick_look_takes_a_twentieth_and_never_nothing(twin):
    quick = BenchOptions(twin, repeats=1000, long_repeats=5).quicker()
    assert (quick.repeats, quick.long_repeats, quick.quick) == (50, 1, True)


@pytest.mark.parametrize(
    ("unit", "value", "text"),
    [
        ("s", 1.234e-3, "1.23 ms"),
        ("s", 12.3e-6, "12.3 µs"),
        ("s", 61.04, "61 s"),
        ("x", 21.34, "21.3 x"),
        ("1", 4.6e-6, "4.6e-06"),
        ("MiB", 1254.2, "1254 MiB"),
        ("%", 0.0, "0 %"),
        ("s", float("nan"), "-"),
    ],
)
def test_values_are_told_with_three_digits_and_their_unit(unit, value, text):
    assert value_in(unit, value) == text


def test_a_table_says_of_every_line_what_came_of_it():
    lines = [
        Measurement("tick", "s", 3e-3, 5e-3, 9, Limit(2e-3, 4e-3), error=2.6e-3, note="loaded"),
        Skipped("PyTorch", "not installed"),
        Failed("plan", "no arm"),
        Growth("modules", "plan", [1, 2], [1.0, 2.0], [1.0, 2.0], 7),
    ]
    tick, skipped, failed = table_rows(lines)
    assert tick == ("tick", "3 ms", "5 ms", "9", "≤ 2 ms, 99 %: ≤ 4 ms MISSED", "error 2.60 mm; loaded")
    assert skipped[1] == "skipped"
    assert failed[1] == "FAILED"
