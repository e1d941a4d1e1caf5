"""`s2c2a robot check --response`: how a body answers, beside what its description or its networks expect."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.cli.console import print_table, progress_bar
from s2c2a.errors import S2C2AError
from s2c2a.files import save_whole

if TYPE_CHECKING:
    from s2c2a.estimation import Margins, Swing
    from s2c2a.estimation.frequency_response import Response
    from s2c2a.estimation.excitation import Shaken
    from s2c2a.robots import Robot
    from s2c2a.strategies import Recipe, TrainedNetworks

TOWARDS = "x", "y"
UNLIKE = 0.5  # of what was seen; where more is not explained, a response says little
ROWS = (
    "first mode [Hz]",
    "damping ratio",
    "gain of slow motion",
    "delay [control steps]",
    "lost at a turn [deg]",
)
NO_SENSORS = "no margins: nothing in the arm file says what comes of it (docs/sensors.md), so no loop could swing"
UNWATCHED = "no margins: plans of recipe '{}' take no notice of what comes of them"


@dataclass(frozen=True)
class Knowledge:
    """What an arm is expected to be.

    Attributes:
        arm: by its file.
        networks: trained for it, if any.
    """

    arm: ArmSpec
    networks: "TrainedNetworks[Recipe] | None"

    @property
    def swing(self) -> "Swing":
        """The trained factors; those of the description else."""
        from s2c2a.estimation import Swing

        return (
            Swing.nominal()
            if self.networks is None
            else self.networks.networks.get("swing", Swing.nominal())
        )

    @property
    def frequency(self) -> float:
        """Of the first mode, without a load [Hz]."""
        from s2c2a.estimation.modal_model import Body, modes, motion

        period = self.arm.control_period
        return float(
            modes(motion(Body.of(self.arm), self.swing, 0.0, period), period)[0, 0]
        )

    def tilts(self, shaken: "Shaken", towards: int) -> np.ndarray:
        """How the tip would have tilted in a chirp [rad]."""
        from s2c2a.estimation.expected_response import (
            expected_tilts,
            rests_by_description,
            rests_by_model,
        )
        from s2c2a.kinematics import configurations_from_bends

        felt = shaken.felt[towards]
        if self.networks is None or not self.networks.recipe.observes:
            rests = rests_by_description(self.arm, self.swing, felt)
        else:
            sensed = np.asarray(configurations_from_bends(felt.astype(np.float32)))
            rests = rests_by_model(self.networks.c2s, sensed)
        return expected_tilts(self.arm, self.swing, rests)[:, towards]


def check_response(robot: "Robot", weights: Path | None, out: Path | None) -> None:
    """Measure how a body answers, and say it beside what is expected."""
    from s2c2a.estimation.frequency_response import response_of
    from s2c2a.estimation.excitation import shaken, sight_of
    from s2c2a.executors import compute_on_one_thread
    from s2c2a.strategies import load_strategy

    compute_on_one_thread()
    arm = robot.arm
    sight_of(robot)  # refused before anything else is read
    known = Knowledge(arm, None if weights is None else load_strategy(weights, arm))
    with progress_bar() as progress:
        told = shaken(
            robot,
            known.frequency,
            lambda done, total: progress("shaking the arm", done, total),
        )
    seen = [told.tilts(towards) for towards in range(2)]
    desired = [known.tilts(told, towards) for towards in range(2)]
    measured, expected = (
        [
            response_of(asked, came, arm.control_period, known.frequency)
            for asked, came in pairs
        ]
        for pairs in (
            seen,
            [(asked, came) for (asked, _), came in zip(seen, desired, strict=True)],
        )
    )
    _print(arm, told.sight, measured, expected)
    found = _margins(known)
    print(found if isinstance(found, str) else verdict(measured, expected, found))
    if out is not None:
        _keep(out, told, desired, measured, expected, arm)


def _print(
    arm: ArmSpec,
    sight: str,
    measured: "Sequence[Response]",
    expected: "Sequence[Response]",
) -> None:
    columns = [
        cells(one) for pair in zip(measured, expected, strict=True) for one in pair
    ]
    header = [
        "",
        *(
            f"{what} {towards}"
            for towards in TOWARDS
            for what in ("towards", "predicted")
        ),
    ]
    print_table(
        f"How {arm.name} answers, as '{sight}' show it",
        header,
        zip(ROWS, *columns, strict=True),
    )
    worst = max(one.left for one in measured)
    print(
        f"not explained by this: {100 * worst:.0f} % of the motion"
        + f"{'; believe none of it' * (worst > UNLIKE)}"
    )


def cells(one: "Response") -> tuple[str, ...]:
    """A response in words, row by row."""
    if np.isnan(one.frequency):
        frequency = "too fast to see"
        damping = "-"
    else:
        frequency = f"{one.frequency:.2f}"
        damping = f"{one.damping:.2f}" if one.damping < 1.0 else "1 or more: no swing"
    numbers = f"{one.gain:.2f}", f"{one.delay:.1f}", f"{np.rad2deg(one.lost):.1f}"
    return frequency, damping, *numbers


def _margins(known: Knowledge) -> "Margins | str":
    """Of the loop with trained networks; why there are none else."""
    from s2c2a.estimation import margins_of
    from s2c2a.strategies import observer_of

    if known.networks is None:
        return "no margins: give --weights, made by `s2c2a train`, to hold this against those of their loop"
    if not known.networks.recipe.observes:
        return UNWATCHED.format(known.networks.recipe.name)
    observer = observer_of(known.networks)
    return margins_of(known.arm, observer) if observer.sensors else NO_SENSORS


def verdict(
    measured: "Sequence[Response]", expected: "Sequence[Response]", margins: "Margins"
) -> str:
    """Whether gain and delay lie within the margins, in words."""
    pairs = list(zip(measured, expected, strict=True))
    gain = max(one.gain / max(other.gain, 1e-6) for one, other in pairs)
    late = max(one.delay - other.delay for one, other in pairs)
    said = f"it answers {gain:.2f} times as much as expected, {abs(late):.1f} steps {'later' if late > 0 else 'earlier'}"
    within = gain <= margins.gain and late <= margins.delay
    return f"{said}: {'within' if within else 'BEYOND'} the margins of its loop ({margins})"


def _keep(
    out: Path,
    told: "Shaken",
    desired: list[np.ndarray],
    measured: "Sequence[Response]",
    expected: "Sequence[Response]",
    arm: ArmSpec,
) -> None:
    from s2c2a.estimation.frequency_response import spectrum
    from s2c2a.viz.response import response_figure

    both = {"measured": measured, "predicted": expected}
    rows = {
        name: dict(zip(TOWARDS, (kept(one) for one in ones), strict=True))
        for name, ones in both.items()
    }
    print(
        f"kept in {save_whole(json.dumps({'arm': arm.name, 'seen_by': told.sight} | rows, indent=1), out)}"
    )
    spectra = {}
    for number, towards in enumerate(TOWARDS):
        asked, seen = told.tilts(number)
        spectra[towards] = [
            spectrum(asked, came, arm.control_period)
            for came in (seen, desired[number])
        ]
    picture = response_figure(spectra, Path(f"{out}.png"), f"How {arm.name} answers")
    print(f"figure: {picture}")


def kept(one: "Response") -> dict[str, float | None]:
    """A response as it stands in a file, without what is not known."""
    return {
        name: number if np.isfinite(number) else None
        for name, number in one._asdict().items()
    }


def check_alone(response: bool, **options: object) -> None:
    """Refuse options of the response where it is not asked for.

    Raises:
        S2C2AError: there is one.
    """
    if not response and (
        given := [f"--{name}" for name, value in options.items() if value is not None]
    ):
        raise S2C2AError(
            f"{' and '.join(given)} go with --response; say that, too, or leave them out"
        )
