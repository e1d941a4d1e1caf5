"""Robot classes by name: simulated, from other packages, or from a user's file."""

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import PydanticUserError, TypeAdapter, ValidationError

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError
from s2c2a.plugins import resolve
from s2c2a.robots.robot import Robot
from s2c2a.validation import describe_fault

SIMULATED = "sim"
KNOWN = {
    SIMULATED: "s2c2a.robots.simulation:SimulatedRobot",
    "dynamixel": "s2c2a.hardware.servo_robot:DynamixelRobot",
    "feetech": "s2c2a.hardware.servo_robot:FeetechRobot",
}
"""Import paths of the package's own robots: users of real arms need no MuJoCo."""


def robot_class(name: str) -> type[Robot]:
    """Return a robot class: "sim", an entry point of `s2c2a.robots`, or module:Class.

    Raises:
        S2C2AError: there is no such class, or it is not a complete robot.
    """
    cls = resolve("robot", KNOWN.get(name, name), KNOWN)
    if not (isinstance(cls, type) and issubclass(cls, Robot)):
        raise S2C2AError(
            f"{name} is {cls!r}, not a robot; give a subclass of s2c2a.robots.Robot"
        )
    missing = sorted(cls.__abstractmethods__)
    if missing:
        raise S2C2AError(
            f"{cls.__name__} is not a complete robot: it lacks {', '.join(missing)}; "
            "see s2c2a.robots.Robot"
        )
    return cls


@dataclass(frozen=True)
class RobotFactory:
    """A choice of robot class and options, which can be sent to other processes.

    Attributes:
        name: "sim", an entry point, or module:Class.
        options: options of the class, such as fidelity or port, as pairs.
    """

    name: str = SIMULATED
    options: tuple[tuple[str, Any], ...] = ()

    def __str__(self) -> str:
        """Return a text such as "sim fidelity=fast"."""
        options = [f"{name}={value}" for name, value in self.options]
        return " ".join([self.name, *options])

    @classmethod
    def simulation(cls, fidelity: str = "fast", **options: Any) -> "RobotFactory":
        """Choose the package's own simulation; options that are zero or empty drop out.

        Options are those of `SimulatedRobot`.
        """
        pairs: list[tuple[str, Any]] = [("fidelity", fidelity)]
        for name, value in options.items():
            if value:
                pairs.append((name, value))
        return cls(SIMULATED, tuple(pairs))

    @property
    def simulated(self) -> bool:
        """Whether it is the package's own simulation."""
        return self.name == SIMULATED

    def make(self, arm: ArmSpec, **defaults: Any) -> Robot:
        """Create the robot of an arm.

        Args:
            arm: its description.
            defaults: options, such as a seed, that apply if the class accepts them and
                `options` does not contain them.

        Raises:
            S2C2AError: there is no such class, the class does not accept an option,
                needs another one, or fails.
        """
        cls = robot_class(self.name)
        parameters = _option_parameters(cls)
        options = {
            name: value for name, value in defaults.items() if name in parameters
        }
        for name, value in self.options:
            options[name] = _convert_option(cls, parameters, name, value)
        for name, parameter in parameters.items():
            if parameter.default is parameter.empty and name not in options:
                raise S2C2AError(
                    f"{cls.__name__} needs {name}; add --robot-option {name}=..."
                )
        create: Callable[..., Robot] = cls
        try:
            return create(arm, **options)
        except (S2C2AError, OSError):
            raise
        except Exception as error:  # the class may be a user's own
            raise S2C2AError(
                f"{cls.__name__} cannot be made: {type(error).__name__}: {error}"
            ) from error

    def seeded(self, arm: ArmSpec, seed: int) -> Robot:
        """Create the robot of an arm with a seed, if its class accepts one."""
        return self.make(arm, seed=seed)


def options_from(texts: Sequence[str]) -> tuple[tuple[str, str], ...]:
    """Parse options of the form `key=value`.

    Raises:
        S2C2AError: a text has no `=`, or a key appears twice.
    """
    options = {}
    for text in texts:
        key, equals, value = text.partition("=")
        if not (key and equals):
            raise S2C2AError(f"'{text}' is not a robot option; write key=value")
        if key in options:
            raise S2C2AError(
                f"the robot option '{key}' appears twice in {', '.join(texts)}; "
                "give each option once"
            )
        options[key] = value
    return tuple(options.items())


def _option_parameters(cls: type[Robot]) -> Mapping[str, inspect.Parameter]:
    """Return the named parameters of a class after the arm."""
    kinds = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    parameters = list(inspect.signature(cls).parameters.values())[1:]
    return {
        parameter.name: parameter for parameter in parameters if parameter.kind in kinds
    }


def _convert_option(
    cls: type[Robot], parameters: Mapping[str, inspect.Parameter], name: str, value: Any
) -> Any:
    """Convert an option to the type that the class declares for it."""
    if name not in parameters:
        raise S2C2AError(
            f"{cls.__name__} has no option '{name}'; "
            f"it has {', '.join(parameters) or 'none'}"
        )
    try:
        annotation = inspect.get_annotations(cls.__init__, eval_str=True)[name]
        return TypeAdapter(annotation).validate_python(value)
    except (KeyError, NameError, PydanticUserError):
        return value  # no type is declared, or none that is known here
    except ValidationError as error:
        fault = error.errors(include_url=False)[0]
        raise S2C2AError(
            f"option {name}={value} of {cls.__name__}: {describe_fault(fault)}"
        ) from error
