"""Command `s2c2a response`: measured and expected frequency response."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from s2c2a.arm import ArmSpec, load_arm
from s2c2a.cli.console import Arm, print_table, progress_bar
from s2c2a.cli.emergency import emergency_controls
from s2c2a.cli.execution import (
    RobotName,
    RobotOptions,
    TrackingSource,
    robot_factory_for,
)
from s2c2a.files import write_atomically

if TYPE_CHECKING:
    from s2c2a.estimation import ModalFactors
    from s2c2a.lab.response.excitation import Excitation
    from s2c2a.lab.response.frequency_response import Response
    from s2c2a.robots import Robot
    from s2c2a.strategies import TrainedNetworks

DIRECTIONS = "x", "y"
MAX_RESIDUAL = 0.5  # share of the motion; above it, a response is unreliable
ROWS = (
    "first mode [Hz]",
    "damping ratio",
    "static gain",
    "delay [control steps]",
    "backlash [deg]",
)


@dataclass(frozen=True)
class ExpectedDynamics:
    """Expected dynamics of an arm.

    Attributes:
        arm: description of the arm.
        networks: trained for it, if any.
    """

    arm: ArmSpec
    networks: "TrainedNetworks | None"

    @property
    def modal_factors(self) -> "ModalFactors":
        """Factors of the modal model: the trained ones, otherwise the nominal ones."""
        from s2c2a.estimation import MODAL_MODEL, ModalFactors

        if self.networks is None:
            return ModalFactors.nominal()
        return self.networks.networks.get(MODAL_MODEL, ModalFactors.nominal())

    @property
    def frequency(self) -> float:
        """Frequency of the first mode, without payload [Hz]."""
        from s2c2a.estimation.modal_model import LinearizedArm, modal_step
        from s2c2a.lab.response.expected_response import modes

        period = self.arm.control_period
        step = modal_step(LinearizedArm.of(self.arm), self.modal_factors, period)
        return float(modes(step, period)[0, 0])

    def tilts(self, chirps: "Excitation", direction: int) -> np.ndarray:
        """Expected tilt of the tip during a chirp [rad]."""
        from s2c2a.estimation import MODAL_MODEL
        from s2c2a.kinematics import configurations_from_bends
        from s2c2a.lab.response.expected_response import (
            equilibria_by_description,
            equilibria_by_model,
            expected_tilts,
        )

        factors = self.modal_factors
        bends = chirps.encoders[direction]
        if self.networks is None or MODAL_MODEL not in self.networks.networks:
            equilibria = equilibria_by_description(self.arm, factors, bends)
        else:
            sensed = configurations_from_bends(bends.astype(np.float32))
            equilibria = equilibria_by_model(self.networks.c2s, np.asarray(sensed))
        return expected_tilts(self.arm, factors, equilibria)[:, direction]


def response(
    robot: RobotName = "sim",
    arm: Arm = "twin_arm",
    robot_option: RobotOptions = (),
    tracking: TrackingSource = "",
    weights: Path | None = None,
    out: Path | None = None,
) -> None:
    """Measure the frequency response of a robot: first mode, gain, delay, backlash.

    The arm vibrates for about a minute, slowly at first and then faster; every module
    bends by a tenth of its limit. Keep clear of it (docs/guides/sensors.md).

    Args:
        robot: the simulated arm, servos (dynamixel, feetech; docs/guides/hardware.md),
            or your own class, such as my_arm.py:MyArm.
        arm: a preset or an arm file that describes the robot.
        robot_option: arguments of the class.
        tracking: source of the poses of a real arm's module ends, such as udp:9763 or
            natnet:192.168.1.10 (docs/guides/tracking.md); by default that of the arm file.
        weights: networks from `s2c2a train`; they give the expected response.
        out: a file (.json) for the measured response, with a figure next to it.
    """
    factory = robot_factory_for(robot, robot_option, tracking=tracking)
    opened = factory.seeded(load_arm(arm), 0)
    with emergency_controls(factory):
        measure_response(opened, weights, out)


def measure_response(robot: "Robot", weights: Path | None, out: Path | None) -> None:
    """Measure the frequency response of a robot, and compare it with the expected one.

    Args:
        robot: opened; it moves.
        weights: networks from `s2c2a train`, if any.
        out: a JSON file for the responses, with a figure next to it.
    """
    from s2c2a.executors import limit_jax_to_one_thread
    from s2c2a.lab.response.excitation import excite, tip_sensor_of
    from s2c2a.lab.response.frequency_response import fit_response
    from s2c2a.strategies import load_networks

    limit_jax_to_one_thread()
    arm = robot.arm
    tip_sensor_of(robot)  # raises an error if no sensor of the robot measures the tip
    networks = None if weights is None else load_networks(weights, arm)
    expectation = ExpectedDynamics(arm, networks)
    frequency = expectation.frequency
    with progress_bar() as progress:

        def on_progress(done: int, total: int) -> None:
            progress("exciting the arm", done, total)

        chirps = excite(robot, frequency, on_progress)
    measured = []
    expected = []
    expected_tilts = []
    for direction in range(len(DIRECTIONS)):
        inputs, outputs = chirps.tilts(direction)
        tilts = expectation.tilts(chirps, direction)
        period = arm.control_period
        measured.append(fit_response(inputs, outputs, period, frequency))
        expected.append(fit_response(inputs, tilts, period, frequency))
        expected_tilts.append(tilts)
    _print_responses(arm, chirps.sensor, measured, expected)
    print(compare_responses(measured, expected))
    if out is not None:
        _save(out, chirps, expected_tilts, measured, expected, arm)


def _print_responses(
    arm: ArmSpec,
    sensor: str,
    measured: "Sequence[Response]",
    expected: "Sequence[Response]",
) -> None:
    header = [""]
    columns = []
    for number, direction in enumerate(DIRECTIONS):
        header += [f"measured {direction}", f"expected {direction}"]
        columns += [cells(measured[number]), cells(expected[number])]
    title = f"Response of {arm.name}, measured by '{sensor}'"
    print_table(title, header, zip(ROWS, *columns, strict=True))
    residual = max(response.residual for response in measured)
    warning = "; the response is unreliable" if residual > MAX_RESIDUAL else ""
    print(f"not explained by the model: {100 * residual:.0f} % of the motion{warning}")


def cells(response: "Response") -> tuple[str, ...]:
    """Table cells of a response, in the order of `ROWS`."""
    if np.isnan(response.frequency):
        frequency = "too fast to see"
        damping = "-"
    else:
        frequency = f"{response.frequency:.2f}"
        damping = f"{response.damping:.2f}"
        if response.damping >= 1.0:
            damping = "1 or more: no vibration"
    return (
        frequency,
        damping,
        f"{response.gain:.2f}",
        f"{response.delay:.1f}",
        f"{np.rad2deg(response.backlash):.1f}",
    )


def compare_responses(
    measured: "Sequence[Response]", expected: "Sequence[Response]"
) -> str:
    """Say how gain and delay of the worst direction differ from the expected ones."""
    pairs = list(zip(measured, expected, strict=True))
    gain = max(real.gain / max(model.gain, 1e-6) for real, model in pairs)
    delay = max(real.delay - model.delay for real, model in pairs)
    order = "later" if delay > 0 else "earlier"
    return (
        f"the gain is {gain:.2f} times the expected one; the response is "
        f"{abs(delay):.1f} steps {order} than expected"
    )


def _save(
    out: Path,
    chirps: "Excitation",
    expected_tilts: list[np.ndarray],
    measured: "Sequence[Response]",
    expected: "Sequence[Response]",
    arm: ArmSpec,
) -> None:
    """Save responses as JSON, and their spectra as a figure."""
    from s2c2a.lab.response.figure import response_figure
    from s2c2a.lab.response.frequency_response import spectrum

    content: dict = {"arm": arm.name, "seen_by": chirps.sensor}
    content["measured"] = dict(zip(DIRECTIONS, map(kept, measured), strict=True))
    content["predicted"] = dict(zip(DIRECTIONS, map(kept, expected), strict=True))
    print(f"saved: {write_atomically(json.dumps(content, indent=1), out)}")
    spectra = {}
    for number, direction in enumerate(DIRECTIONS):
        inputs, outputs = chirps.tilts(number)
        spectra[direction] = [
            spectrum(inputs, tilts, arm.control_period)
            for tilts in (outputs, expected_tilts[number])
        ]
    title = f"Response of {arm.name}"
    print(f"figure: {response_figure(spectra, Path(f'{out}.png'), title)}")


def kept(response: "Response") -> dict[str, float | None]:
    """A response as JSON values; None for numbers that are not finite."""
    return {
        name: number if np.isfinite(number) else None
        for name, number in response._asdict().items()
    }
