"""What a sweep may vary, as a user writes it."""

from dataclasses import replace

import pytest

from s2c2a.errors import S2C2AError
from s2c2a.planning import Horizon
from s2c2a.strategies import recipe_named, strategy_named
from s2c2a_experiments.search_space import (
    Varied,
    value_at,
    varied_from,
    with_options,
    with_values,
)

BEST, PAPER = recipe_named("best"), recipe_named("paper")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            "planner.solver.iterations=5:60",
            Varied("planner.solver.iterations", (5, 60), is_range=True),
        ),
        ("c2s.hidden=32,64,128", Varied("c2s.hidden", (32, 64, 128))),
        ("integral_gain=0,0.2,0.2", Varied("integral_gain", (0.0, 0.2))),
        (
            "c2s_fit.learning_rate=1e-4:1e-2:log",
            Varied("c2s_fit.learning_rate", (1e-4, 1e-2), is_range=True, log=True),
        ),
        (
            "planner.engaged_slopes=true,false",
            Varied("planner.engaged_slopes", (True, False)),
        ),
        (
            "planner.terms.Evenness.weight=0,0.1",
            Varied("planner.terms.Evenness.weight", (0.0, 0.1)),
        ),
        ("speeds.1=0.03:0.2", Varied("speeds.1", (0.03, 0.2), is_range=True)),
        (
            "axis_weights.0.1=1:20",
            Varied("axis_weights.0.1", (1.0, 20.0), is_range=True),
        ),
    ],
)
def test_search_spaces_are_parsed(text, expected):
    assert varied_from([text], BEST) == (expected,)


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        ([], "nothing to vary; name every place once"),
        (["integral_gain=0,1", "integral_gain=0:1"], "name every place once"),
        (
            ["planner.solver.iteration=5:60"],
            r"has planner\.solver\.iterations, planner\.solver\.change, .*acceleration$",
        ),
        (["plan=1,2"], "recipe best has c2s, c2a"),
        (
            ["planner=1,2"],
            r"vary one of planner\.solver, planner\.terms, planner\.guides, ",
        ),
        (["speeds=1,2"], r"vary one of speeds\.0, speeds\.1"),
        (["correction.x=1,2"], "nothing to vary at"),
        (["name=1,2"], "nothing to vary at 'name'"),
        (["planner.guard=1,2"], "nothing to vary"),
        (["planner.iterations=5:60"], r"planner has planner\.solver, planner\.terms"),
        (
            ["planner.terms.1=1,2"],
            r"planner\.terms has planner\.terms\.Positions, planner\.terms\.Axes",
        ),
        (["planner.terms.Pool.weight=1,2"], "Evenness"),
        (["planner.terms.Axes.name=1,2"], r"has planner\.terms\.Axes\.weight$"),
        (["axis_weights.0.0=1,2"], "'hold-'; only numbers"),
        (["planner.solver.iterations"], "has no values to try"),
        (["planner.solver.iterations="], "has no values to try"),
        (["planner.solver.iterations=5.5:60"], "write a whole number"),
        (["integral_gain=little"], "write a number"),
        (["unit_length=1,0"], "write true, false or both"),
        (["unit_length=false:true"], "is no range"),
        (["integral_gain=0.2:0.1"], "is no range"),
        (["integral_gain=0:nan"], "write a number"),
        (["integral_gain=0,inf"], "write a number"),
        (["integral_gain=0:1:log"], "above zero"),
        (["integral_gain=0.1:1:linear"], "is no range"),
        (["integral_gain=0.1:1:2:3"], "is no range"),
        (
            ["planner.solver.iterations=0:60"],
            "planner.solver.iterations=0 cannot be tried: iterations = 0 was given",
        ),
        (["c2s.hidden=32,5000"], "c2s.hidden=5000 cannot be tried"),
        (["speeds.0=0.01:0.2"], "speeds.0=0.2 cannot be tried: speeds"),
    ],
)
def test_invalid_search_spaces_are_rejected(texts, message):
    with pytest.raises(S2C2AError, match=message):
        varied_from(texts, BEST)


def test_values_change_their_place_only():
    changed = with_values(
        BEST,
        {"planner.solver.iterations": 7, "speeds.1": 0.12, "axis_weights.0.1": 2.0},
    )
    assert changed.planner == replace(BEST.planner, solver=Horizon(7))
    assert (changed.speeds, changed.axis_weights) == ((0.03, 0.12), (("hold-", 2.0),))
    assert (
        replace(
            changed,
            planner=BEST.planner,
            speeds=BEST.speeds,
            axis_weights=BEST.axis_weights,
        )
        == BEST
    )
    assert value_at(changed, "planner.solver.iterations") == 7


def test_places_are_those_of_the_given_recipe():
    assert value_at(PAPER, "c2s.layers") == 4
    with pytest.raises(S2C2AError, match=r"c2s has c2s\.hidden, c2s\.depth"):
        value_at(BEST, "c2s.layers")


@pytest.mark.parametrize(
    ("value", "held"), [(5, True), (60, True), (30, True), (61, False)]
)
def test_a_range_holds_its_ends_and_the_values_between(value, held):
    assert varied_from(["planner.solver.iterations=5:60"], BEST)[0].holds(value) is held
    assert not varied_from(["planner.solver.iterations=5,60"], BEST)[0].holds(30)


def test_options_of_the_strategy_are_varied_beside_the_recipe(tmp_path):
    file = tmp_path / "own.py"
    file.write_text(
        "from dataclasses import dataclass\n"
        "from s2c2a.strategies import StrategyOptions\n"
        "@dataclass(frozen=True)\n"
        "class Own(StrategyOptions):\n"
        "    gain: float = 0.5\n"
        "    limits = {'gain': (0, 1)}\n"
        "    def build(self, arm, recipe, trained, run):\n"
        "        raise NotImplementedError\n"
    )
    own = f"{file}:Own"
    (varied,) = varied_from(["strategy.gain=0.1:1:log"], BEST, own)
    assert (varied.choices, varied.log) == ((0.1, 1.0), True)
    assert value_at(BEST, "strategy.gain", own) == 0.5
    values = {"strategy.gain": 0.25, "integral_gain": 0.2}
    assert strategy_named(with_options(own, values)).gain == 0.25
    assert strategy_named(with_options(f"{own},gain=0.75", values)).gain == 0.25
    assert with_values(BEST, values).integral_gain == 0.2
    with pytest.raises(S2C2AError, match=r"strategy\.gain=2\.0 cannot be tried"):
        varied_from(["strategy.gain=0.1:2"], BEST, own)
    with pytest.raises(S2C2AError, match=r"nothing to vary at 'strategy\.pain'"):
        varied_from(["strategy.pain=0.1:2"], BEST, own)
