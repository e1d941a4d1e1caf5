"""What grows in the benchmark grows alone, and is drawn with its exponent."""

from dataclasses import replace

import pytest

from s2c2a.bench import growth, simulation
from s2c2a.bench.batch import batches
from s2c2a.bench.collect import collecting
from s2c2a.bench.figure import draw_growths
from s2c2a.bench.measurement import Growth
from s2c2a.bench.options import BenchOptions
from s2c2a.bench.step import parts_of_a_tick, whole_ticks
from s2c2a.bench.training import training
from s2c2a.data import CollectOptions
from s2c2a.errors import S2C2AError


def quiet(*_):
    """A progress that tells nobody."""


@pytest.fixture
def tiny_growth(monkeypatch, tiny_recipe):
    """Growth of the tiny recipe alone."""
    monkeypatch.setattr(growth, "RECIPES", ("tiny",))
    monkeypatch.setattr(growth, "recipe_named", lambda name: tiny_recipe)
    return growth


@pytest.mark.parametrize("count", [1, 2, 3, 7, 20])
def test_an_arm_of_more_modules_is_as_long_and_has_the_same_cables(twin, count):
    arm = growth.arm_of_modules(twin, count)
    assert arm.module_count == count
    assert arm.cable_count == twin.cable_count
    assert arm.length == pytest.approx(twin.length)


@pytest.mark.parametrize("count", range(3, 9))
def test_an_arm_of_more_cables_has_as_many_modules_and_can_bend_every_way(simulated, count):
    arm = growth.arm_of_cables(simulated, count)
    assert (arm.module_count, arm.cable_count) == (simulated.module_count, count)


@pytest.mark.parametrize("count", [0, 1, 64])
def test_so_many_obstacles_are_in_use(twin, count):
    goals = growth.among_obstacles(twin, count)
    assert all((goal.thresholds > 0).sum() == count for goal in goals)


def test_plans_and_ticks_are_followed_over_modules(tiny_growth, twin):
    lines = list(tiny_growth.with_modules(twin, (1, 2), 2, quiet))
    followed = [line for line in lines if isinstance(line, Growth)]
    assert [(line.of, line.what) for line in followed] == [("modules", "plan, tiny"), ("modules", "whole tick, tiny")]
    assert all(min(line.medians) > 0 for line in followed)
    compiled = [line.what for line in lines if line.what.startswith("compiling")]
    assert compiled == ["compiling, tiny, 1 modules", "compiling, tiny, 2 modules"]


def test_plans_are_followed_over_obstacles(tiny_growth, twin):
    followed, exponent = tiny_growth.with_obstacles(twin, (0, 1, 64), 2, quiet)
    assert followed.sizes == (0, 1, 64)
    assert exponent.limit.median == 1.0


def test_reading_and_reach_are_followed_over_waypoints(twin):
    lines = [line for line in growth.with_waypoints(twin, (10, 20), 1, quiet) if isinstance(line, Growth)]
    assert [line.what for line in lines] == ["read and make a task", "check the reach"]
    assert [line.sizes for line in lines] == [(10, 20)] * 2


def test_batches_tell_the_time_of_each_plan(tiny_networks):
    each, past, followed, exponent = batches(tiny_networks, (1, 3), 2, quiet)
    assert each.median == pytest.approx(followed.medians[-1] / 3)
    assert past.median > 0
    assert exponent.unit == "1"


def test_every_part_of_a_tick_is_measured(tiny_networks):
    names = [line.what for line in parts_of_a_tick(tiny_networks, 2, quiet)]
    assert names == ["sense, tiny", "C2A, tiny", "inverse PCC, tiny"]
    assert [line.limit.percentile_99 for line in whole_ticks(tiny_networks, 2, quiet)] == [4e-3] * 3


def test_simulating_tells_speed_by_threads_and_the_error_beside_it(twin, monkeypatch):
    monkeypatch.setattr(simulation, "STEPS", {"fast": 20, "accurate": 4})
    lines = list(simulation.speeds(BenchOptions(twin, long_repeats=1), {"fast": 0.002, "accurate": 0.009}, quiet))
    told = {line.what: line for line in lines}
    assert told["fast, 1 thread(s)"].error == 0.002
    assert told["fast, 1 thread(s)"].median > told["accurate, 1 thread(s)"].median > 0


def test_collecting_is_timed_whole(twin):
    line = collecting(BenchOptions(twin, long_repeats=2), CollectOptions(episodes=2, samples=60), quiet)
    assert line.what.startswith("120 samples")
    assert line.repeats == 2


def test_training_is_timed_by_epochs_and_to_the_stop(recording, tiny_recipe, twin):
    options = BenchOptions(twin)
    lines = {line.what: line for line in training(recording, tiny_recipe, options, quiet, beside=False)}
    whole = lines["both networks to their stop, tiny"]
    assert "C2S 12 epochs" in whole.note
    assert whole.median > lines["an epoch of C2S, tiny"].median > 0


@pytest.mark.parametrize("whole", [False, True])
def test_pytorch_trains_between_our_calls_and_its_time_is_not_ours(recording, tiny_recipe, twin, whole):
    pytest.importorskip("torch", reason='PyTorch is not installed; it comes with the extra "bench"')
    options = BenchOptions(twin, whole=whole)
    lines = list(training(recording, tiny_recipe, options, quiet, beside=True))
    ours, theirs, times = lines[-3:]
    assert times.median == pytest.approx(theirs.median / ours.median)
    assert ("trained whole" in theirs.note) is whole
    epochs = [line for line in lines if "PyTorch on" in line.what]
    assert [line.repeats for line in epochs] == ([12, 12] if whole else [2, 2])


def a_growth(of: str) -> Growth:
    sizes = (0, 1, 10, 100)
    return Growth(of, "plan", sizes, tuple(1e-3 * (1 + s) for s in sizes), tuple(2e-3 * (1 + s) for s in sizes), 9)


def test_growths_are_drawn_with_their_exponents(tmp_path):
    growths = [a_growth("modules"), replace(a_growth("modules"), what="tick"), a_growth("cables")]
    assert draw_growths(growths, tmp_path / "growth.png").stat().st_size > 20_000


def test_nothing_to_draw_is_refused(tmp_path):
    with pytest.raises(S2C2AError, match="growth"):
        draw_growths([], tmp_path / "growth.png")
