"""Bodies by name: the simulated one, those of other packages, and a user's own."""

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import PydanticUserError, TypeAdapter, ValidationError

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError
from s2c2a.plugins import found
from s2c2a.validation import said
from s2c2a.robots.robot import Robot

SIMULATED = "sim"
KNOWN = {SIMULATED: "s2c2a.robots.simulation:SimulatedRobot"}
"""The package's own bodies, by where they stand: who has motors needs no MuJoCo."""


def robot_class(name: str) -> type[Robot]:
    """The class of a body: "sim", an entry point of `s2c2a.robots`, or module:Class.

    Raises:
        S2C2AError: no such class, or it is no robot.
    """
    chosen = found("robot", KNOWN.get(name, name), KNOWN)
    if not (isinstance(chosen, type) and issubclass(chosen, Robot)):
        raise S2C2AError(
            f"{name} is {chosen!r}, no robot; give a subclass of s2c2a.robots.Robot"
        )
    if lacking := sorted(chosen.__abstractmethods__):
        raise S2C2AError(
            f"{chosen.__name__} is half a robot: it lacks {', '.join(lacking)}; see s2c2a.robots.Robot"
        )
    return chosen


@dataclass(frozen=True)
class Body:
    """What is driven, and how it is made; it travels to other processes.

    Attributes:
        name: "sim", an entry point, or module:Class.
        options: of its class, such as fidelity or a port, as pairs.
    """

    name: str = SIMULATED
    options: tuple[tuple[str, Any], ...] = ()

    def __str__(self) -> str:
        """Such as "sim fidelity=fast"."""
        return " ".join([self.name, *(f"{key}={value}" for key, value in self.options)])

    @classmethod
    def simulation(cls, fidelity: str = "fast", **chosen: float | str) -> "Body":
        """The package's own simulation, such as with a payload; what is zero or nothing needs no word."""
        return cls(
            SIMULATED,
            (
                ("fidelity", fidelity),
                *((name, value) for name, value in chosen.items() if value),
            ),
        )

    @property
    def simulated(self) -> bool:
        """Whether it is the package's own simulation."""
        return self.name == SIMULATED

    def make(self, arm: ArmSpec, **offered: Any) -> Robot:
        """The body of an arm.

        Args:
            arm: its description.
            offered: what its class is given where it takes it, such as a seed.

        Raises:
            S2C2AError: no such class, an option that it does not take, or it cannot be
                made.
        """
        kind = robot_class(self.name)
        taken = _parameters(kind)
        offers = {name: value for name, value in offered.items() if name in taken}
        chosen = {
            name: _converted(kind, taken, name, value) for name, value in self.options
        }
        for name, one in taken.items():
            if one.default is one.empty and name not in offers | chosen:
                raise S2C2AError(
                    f"{kind.__name__} needs {name}; say --robot-option {name}=..."
                )
        make: Callable[..., Robot] = kind
        try:
            return make(arm, **offers | chosen)
        except (S2C2AError, OSError):
            raise
        except Exception as error:  # others may have written it
            raise S2C2AError(
                f"{kind.__name__} cannot be made: {type(error).__name__}: {error}"
            ) from error

    def seeded(self, arm: ArmSpec, seed: int) -> Robot:
        """The same with a seed, where its class takes one: what makes a robot for every episode."""
        return self.make(arm, seed=seed)


def options_from(texts: Sequence[str]) -> tuple[tuple[str, str], ...]:
    """`key=value` as a user writes them.

    Raises:
        S2C2AError: one has no `=`, or a key stands twice.
    """
    pairs = [text.partition("=") for text in texts]
    if wrong := [
        text
        for text, (key, equals, _) in zip(texts, pairs, strict=True)
        if not (key and equals)
    ]:
        raise S2C2AError(f"'{wrong[0]}' is no option of a robot; write key=value")
    if len({key for key, _, _ in pairs}) < len(pairs):
        raise S2C2AError(
            f"an option of the robot stands twice in {', '.join(texts)}; give each once"
        )
    return tuple((key, value) for key, _, value in pairs)


def _parameters(kind: type[Robot]) -> Mapping[str, inspect.Parameter]:
    """What a class takes beside the arm."""
    parameters = list(inspect.signature(kind).parameters.values())[1:]
    named = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    return {one.name: one for one in parameters if one.kind in named}


def _converted(
    kind: type[Robot], taken: Mapping[str, inspect.Parameter], name: str, value: Any
) -> Any:
    """An option as the kind of value that its class asks for."""
    if name not in taken:
        raise S2C2AError(
            f"{kind.__name__} takes no option '{name}'; it takes {', '.join(taken) or 'none'}"
        )
    try:
        desired = inspect.get_annotations(kind.__init__, eval_str=True)[name]
        return TypeAdapter(desired).validate_python(value)
    # no kind is stated, or none that is known here
    except (KeyError, NameError, PydanticUserError):
        return value
    except ValidationError as error:
        (fault, *_) = error.errors(include_url=False)
        raise S2C2AError(
            f"option {name}={value} of {kind.__name__}: {said(fault)}"
        ) from error
