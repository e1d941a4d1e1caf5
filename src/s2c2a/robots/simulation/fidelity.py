"""How finely the arm is cut up, in space and time."""

from dataclasses import dataclass

from s2c2a.errors import S2C2AError


@dataclass(frozen=True)
class Fidelity:
    """A layout of the chain.

    Attributes:
        name: the word a user types.
        segments: rigid segments a module, a multiple of five: five points of each centre line are watched.
        torsion: whether modules can twist about their own axis.
        routed_cables: cables led through points in space (true), or acting on the joints alone (false: faster).
        time_step: largest physics step [s]; shortened so that it divides the control period.
        explicit_time_step: the same with springs as they are at the step's start instead of at its end: nearer to the
            true motion and quicker, but only stable with springs that are soft enough for it; none: never.
    """

    name: str
    segments: int
    torsion: bool
    routed_cables: bool
    time_step: float
    explicit_time_step: float | None = None


FIDELITIES = {
    "fast": Fidelity("fast", segments=5, torsion=False, routed_cables=False, time_step=0.005),
    "accurate": Fidelity(
        "accurate", segments=10, torsion=True, routed_cables=True, time_step=0.002, explicit_time_step=0.003
    ),
}


def fidelity_named(name: str) -> Fidelity:
    """Look a fidelity up.

    Raises:
        S2C2AError: no such fidelity.
    """
    if name not in FIDELITIES:
        raise S2C2AError(f"no fidelity '{name}'; choose one of {', '.join(FIDELITIES)}")
    return FIDELITIES[name]
