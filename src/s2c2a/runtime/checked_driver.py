"""A controller, perhaps a user's own: its exceptions and answers are checked."""

import warnings
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from typing import Generic

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.episodes.episode import SENSOR
from s2c2a.errors import ControllerError, S2C2AError
from s2c2a.goals import Goal
from s2c2a.runtime.border import named_errors
from s2c2a.runtime.driver import Driver, EstimateT, PlanT
from s2c2a.runtime.record import OWN_COLUMNS
from s2c2a.spaces import FOLLOWS_FROM, Actions, Reading, Sensor

METHODS = ("start", "estimate", "plan", "act", "sent", "diagnostics")
ATTRIBUTES = ("arm", "sensors")
NOT_FINITE = (
    "`act` of the controller {} returns values that are NaN or infinite; their cables "
    "hold the last command"
)


class CheckedDriver(Generic[EstimateT, PlanT]):
    """The methods of a `Driver`; a failure becomes a `ControllerError` that names it.

    Attributes:
        driver: the controller.
    """

    def __init__(
        self, driver: Driver[EstimateT, PlanT], arm: ArmSpec, step: Callable[[], int]
    ):
        """A controller that has not started.

        Args:
            driver: the controller.
            arm: that it shall control.
            step: returns the number of the control step, for messages.

        Raises:
            S2C2AError: it lacks a method or an attribute.
        """
        missing = [
            *(f"`{name}`" for name in ATTRIBUTES if not hasattr(driver, name)),
            *(f"`{name}()`" for name in METHODS if not hasattr(driver, name)),
        ]
        if missing:
            raise S2C2AError(
                f"the controller {type(driver).__name__} has no {', '.join(missing)}; "
                "see `runtime.Driver` (docs/guides/extending.md)"
            )
        self.driver = driver
        self._arm = arm
        self._step = step

    @property
    def name(self) -> str:
        """Name in records; that of its class if it has none."""
        with self._errors("name"):
            return str(getattr(self.driver, "name", type(self.driver).__name__))

    def required_sensors(self, sensors: Mapping[str, Sensor]) -> list[str]:
        """Return the names of the robot's sensors that the controller requires.

        Raises:
            S2C2AError: it is for another arm, or requires a sensor that the robot
                lacks.
        """
        kind = type(self.driver).__name__
        with named_errors(ControllerError, f"{kind}.arm failed"):
            theirs = self.driver.arm.module_count, self.driver.arm.cable_count
        ours = self._arm.module_count, self._arm.cable_count
        if theirs != ours:
            raise S2C2AError(
                f"the controller is for an arm of (modules, cables) {theirs}; "
                f"'{self._arm.name}' has {ours}; choose a controller for this arm"
            )
        with named_errors(ControllerError, f"{kind}.sensors failed"):
            names = tuple(self.driver.sensors)
        required = [
            name if name in sensors else FOLLOWS_FROM.get(name, name) for name in names
        ]
        missing = [name for name in required if name not in sensors]
        if missing:
            raise S2C2AError(
                f"the controller needs {', '.join(missing)}; "
                f"the robot provides {', '.join(sensors) or 'no sensor'}; "
                "change `sensing` in the arm file, or choose another robot"
            )
        return required

    def set_real_time(self, is_real: bool) -> None:
        """Tell the controller whether steps must not wait, if it has this method."""
        tell = getattr(self.driver, "set_real_time", None)
        if tell is not None:
            with self._errors("set_real_time"):
                tell(is_real)

    def start(self, reading: Reading) -> None:
        """Start the controller."""
        with self._errors("start"):
            self.driver.start(reading)

    def estimate(self, reading: Reading, last_command: Actions) -> EstimateT:
        """Return its estimate."""
        with self._errors("estimate"):
            return self.driver.estimate(reading, last_command)

    def plan(self, estimate: EstimateT, goal: Goal) -> PlanT:
        """Return its plan."""
        with self._errors("plan"):
            return self.driver.plan(estimate, goal)

    def act(self, plan: PlanT, estimate: EstimateT) -> Actions:
        """Return a copy of the desired command; warn where it is NaN or infinite.

        Raises:
            ControllerError: it has another shape, or holds no numbers.
        """
        with self._errors("act"):
            desired = np.array(self.driver.act(plan, estimate), dtype=float)
        expected = (self._arm.module_count, self._arm.cable_count)
        if desired.shape != expected:
            raise ControllerError(
                f"`act` of the controller {type(self.driver).__name__} returned shape "
                f"{desired.shape} in step {self._step()}; it must return the command "
                f"of every cable [m or N], shape (modules, cables) {expected}"
            )
        if not np.isfinite(desired).all():
            warnings.warn(NOT_FINITE.format(type(self.driver).__name__), stacklevel=1)
        return desired

    def sent(self, action: Actions) -> None:
        """Tell it the command that replaced its action."""
        with self._errors("sent"):
            self.driver.sent(action)

    def diagnostics(self) -> dict[str, np.ndarray]:
        """Return copies of the telemetry.

        Raises:
            ControllerError: a column would replace what the loop records.
        """
        with self._errors("diagnostics"):
            telemetry = dict(self.driver.diagnostics())
            columns = {name: np.array(value) for name, value in telemetry.items()}
        for name in columns:
            is_text = isinstance(name, str)
            if not is_text or name in OWN_COLUMNS or name.startswith(SENSOR):
                raise ControllerError(
                    f"{self._failure('diagnostics')}: {name!r} is no name "
                    "for a controller's own telemetry; choose a text other than "
                    f"{', '.join(sorted(OWN_COLUMNS))}, without '{SENSOR}' before it"
                )
        return columns

    def _errors(self, method: str) -> AbstractContextManager[None]:
        return named_errors(ControllerError, self._failure(method))

    def _failure(self, method: str) -> str:
        return f"{type(self.driver).__name__}.{method} failed in step {self._step()}"
