"""Robot classes by name: simulated, from other packages, or from a user's file."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError
from s2c2a.plugins.discovery import resolve, trust_code
from s2c2a.plugins.options import convert_option, named_parameters
from s2c2a.robots.robot import Robot

SIMULATED = "sim"
NO_TRACKING = "none"
TRACKED = "tracked"
"""Name of the robot wrapper that adds tracked poses."""


def robot_class(name: str) -> type[Robot]:
    """Return a robot class: "sim", an entry point of `s2c2a.robots`, or module:Class.

    Raises:
        S2C2AError: there is no such class, or it is not a complete robot.
    """
    trust_code(name)
    cls = resolve("robot", name, {})
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
        tracking: source of the poses of a real arm's module ends (docs/guides/tracking.md);
            empty: that of the arm file, "none": no source.
    """

    name: str = SIMULATED
    options: tuple[tuple[str, Any], ...] = ()
    tracking: str = ""

    def __str__(self) -> str:
        """Return a text such as "sim fidelity=fast"."""
        options = [f"{name}={value}" for name, value in self.options]
        tracking = [f"tracking={self.tracking}"] if self.tracking else []
        return " ".join([self.name, *options, *tracking])

    @classmethod
    def simulation(cls, fidelity: str = "fast", **options: Any) -> "RobotFactory":
        """Choose the package's own simulation; options that are zero or empty drop out.

        Options are those of `SimulatedRobot`.
        """
        given = [(name, value) for name, value in options.items() if value]
        return cls(SIMULATED, (("fidelity", fidelity), *given))

    @property
    def simulated(self) -> bool:
        """Whether it is the package's own simulation."""
        return self.name == SIMULATED

    def accepts(self, option: str) -> bool:
        """Whether the class has an option, such as a seed.

        Raises:
            S2C2AError: there is no such class.
        """
        return option in named_parameters(robot_class(self.name))

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
        robot = self._make_robot(arm, defaults)
        trust_code(self.tracking)
        source = self.tracking_source(arm)
        if not source:
            return robot
        return resolve("robot_wrapper", TRACKED, {})(robot, source)

    def tracking_source(self, arm: ArmSpec) -> str:
        """Source of the poses of the module ends; empty for none."""
        if self.simulated or self.tracking == NO_TRACKING:
            return ""
        return self.tracking or (arm.tracking.source if arm.tracking else "")

    def describe_calibration(self, arm: ArmSpec) -> str:
        """Which calibration the tracker of the arm uses; empty without a tracker.

        Raises:
            S2C2AError: the file is damaged or of another arm.
        """
        if not self.tracking_source(arm):
            return ""
        return resolve("robot_wrapper", TRACKED, {}).describe_calibration(arm)

    def _make_robot(self, arm: ArmSpec, defaults: Mapping[str, Any]) -> Robot:
        cls = robot_class(self.name)
        parameters = dict(list(named_parameters(cls).items())[1:])  # after the arm
        options = {name: defaults[name] for name in defaults if name in parameters}
        for name, value in self.options:
            options[name] = convert_option(cls, parameters, name, value)
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
            text = f"{cls.__name__} cannot be made: {type(error).__name__}: {error}"
            # the class may expect numbers
            texts = [name for name in options if isinstance(options[name], str)]
            if texts:
                text += (
                    f" (text was given for {', '.join(texts)}; annotate the parameter "
                    "in __init__, such as `gain: float`, to receive a number)"
                )
            raise S2C2AError(text) from error

    def seeded(self, arm: ArmSpec, seed: int) -> Robot:
        """Create the robot of an arm with a seed, if its class accepts one."""
        return self.make(arm, seed=seed)
