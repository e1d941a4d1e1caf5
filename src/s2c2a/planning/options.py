"""How to plan: with which terms, guides and solver. `PAPER` is the paper's way, `BEST` that of the recipe `best`."""

from dataclasses import dataclass, field
from typing import Annotated, ClassVar

from pydantic import BeforeValidator, ConfigDict, SkipValidation

from s2c2a.errors import S2C2AError
from s2c2a.parts import Kind, Own
from s2c2a.planning import terms
from s2c2a.planning.detour import Detour
from s2c2a.planning.guides import Guide, Pull
from s2c2a.planning.situation import Guard
from s2c2a.planning.solvers import SOLVERS, Adam, LeastSquares, Solver
from s2c2a.planning.terms import TERMS, Term

GUIDES = Kind.of("guide", Guide, Detour, Pull)
WORKSPACE_SHARE = 0.46 / 0.6
"""Half the width of the paper's workspace over the length of its arm (Chen et al. 2025, sec. II-D)."""

AnySolver = Annotated[Solver | Own, SkipValidation, BeforeValidator(SOLVERS.read)]
AnyTerm = Annotated[Term | Own, SkipValidation, BeforeValidator(TERMS.read)]
AnyGuide = Annotated[Guide | Own, SkipValidation, BeforeValidator(GUIDES.read)]


@dataclass(frozen=True)
class PlannerOptions:
    """What a planner is made of. In files, parts are tables with their name and numbers, or `Own`.

    Attributes:
        solver: finds configurations.
        terms: what they are judged by.
        guides: what may change the goal before, one after the other.
        engaged_slopes: whether slopes are those of taut cables that follow their motors (`ForwardModel.for_planning`),
            or the true ones.
        on_sphere: whether configurations are kept at unit length and within the bend limits. Those sensed under sensing
            coupling are not of unit length.
        guard: what keeps out of obstacles.
        own_code: whether parts by name may be files and modules; never in a strategy file, which may be a stranger's.
    """

    __pydantic_config__: ClassVar[ConfigDict] = {"extra": "forbid"}

    solver: AnySolver
    terms: tuple[AnyTerm, ...]
    guides: tuple[AnyGuide, ...] = ()
    engaged_slopes: bool = False
    on_sphere: bool = True
    guard: Guard = "tip"
    own_code: bool = field(default=True, compare=False)

    def __post_init__(self):
        """Refuse what cannot plan."""
        if not self.terms:
            raise S2C2AError("a planner without terms asked for; give at least one")

    def made(self) -> tuple[Solver, tuple[Term, ...], tuple[Guide, ...]]:
        """Solver, terms and guides; those asked for by name are found.

        Raises:
            S2C2AError: one is not found, may not be imported, or does not take its parameters.
        """
        terms = tuple(TERMS.made(term, self.own_code) for term in self.terms)
        guides = tuple(GUIDES.made(guide, self.own_code) for guide in self.guides)
        return SOLVERS.made(self.solver, self.own_code), terms, guides


PAPER = PlannerOptions(
    Adam(), (terms.Positions(WORKSPACE_SHARE), terms.Axes(), terms.Repulsion(WORKSPACE_SHARE), terms.Change())
)
_BEST = terms.Positions, terms.Axes, terms.BendChange, terms.Shape, terms.Evenness, terms.Limits, terms.Obstacles
BEST = PlannerOptions(LeastSquares(), tuple(term() for term in _BEST), (Detour(), Pull()), engaged_slopes=True)
