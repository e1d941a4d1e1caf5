"""Options of every kind have limits and are found by one registry."""

import sys
from dataclasses import dataclass
from importlib.metadata import EntryPoint
from typing import ClassVar

import pytest

from s2c2a.errors import S2C2AError, StrategyError, UntrustedCodeError
from s2c2a.plugins import components, trust_code
from s2c2a.plugins.components import (
    Component,
    CustomComponent,
    Options,
    Ranges,
    Registry,
)


@dataclass(frozen=True)
class Spring(Component):
    stiffness: float = 1.0
    iterations: int = 3


@dataclass(frozen=True)
class Sizes(Options):
    layers: int = 2
    widths: tuple[float, ...] = (0.1,)
    limits: ClassVar[Ranges] = {"layers": (1, 32), "widths": (1e-6, 10)}


SPRINGS = Registry("term", Spring, {"Spring": Spring})


@pytest.mark.parametrize(
    ("kind", "options", "message"),
    [
        (Sizes, {"layers": 0}, "layers = 0 was given in Sizes; choose 1 to 32"),
        (Sizes, {"widths": (0.1, float("nan"))}, "widths .* was given in Sizes"),
        (Sizes, {"widths": (0.1,) * 101}, "101 values of widths were given in Sizes"),
        (Spring, {"stiffness": -1.0}, "stiffness = -1.0 was given in Spring"),
        (Spring, {"iterations": 0}, "iterations = 0 was given in Spring; choose 1"),
    ],
)
def test_a_number_out_of_range_names_the_class_and_its_limits(kind, options, message):
    with pytest.raises(S2C2AError, match=message):
        kind(**options)


@pytest.mark.parametrize("value", ["Spring", {"name": "Spring"}, Spring()])
def test_a_component_is_read_from_a_name_a_table_or_itself(value):
    assert SPRINGS.read(value) == Spring()
    assert SPRINGS.build(SPRINGS.read(value)) == Spring()


def test_every_way_to_a_class_that_is_of_another_kind_is_refused_alike():
    name = f"{__name__}:Sizes"
    ways = (
        lambda: SPRINGS.named(name),
        lambda: SPRINGS.find(name),
        lambda: SPRINGS.imported(name),
        lambda: SPRINGS.build(CustomComponent(name)),
        lambda: SPRINGS.build(Sizes()),
    )
    for way in ways:
        with pytest.raises(StrategyError, match=r"is no term; derive it from .*Spring"):
            way()


def test_only_the_name_that_a_user_gives_is_trusted():
    name = "own_spring_that_is_nowhere:Mine"
    ways = (
        SPRINGS.find,
        SPRINGS.imported,
        lambda name: SPRINGS.build(CustomComponent(name)),
    )
    for way in ways:
        with pytest.raises(UntrustedCodeError):
            way(name)
    for way in ways:
        trust_code(name)
        with pytest.raises(S2C2AError, match="cannot be loaded: ModuleNotFoundError"):
            way(name)
    assert "own_spring_that_is_nowhere" not in sys.modules


def test_a_class_has_the_name_of_its_entry_point_where_it_is_installed(monkeypatch):
    point = EntryPoint("mine", f"{__name__}:Sizes", "s2c2a.terms")
    monkeypatch.setattr(components, "installed", lambda kind: {"mine": point})
    registry = Registry("term", Options, {})
    assert registry.name_of(Sizes) == "mine"
    assert registry.imported("mine") is Sizes


def test_a_class_has_its_registered_name_or_that_of_its_module():
    assert SPRINGS.name_of(Spring) == "Spring"
    assert SPRINGS.name_of(Sizes) == f"{__name__}:Sizes"
    assert SPRINGS.imported("Spring") is Spring
