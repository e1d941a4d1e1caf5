"""An arm that is shaken gently: chirps of bends, all modules together, towards x, then towards y."""

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.data.collecting import Player
from s2c2a.errors import S2C2AError
from s2c2a.kinematics import PCC, states_from_configurations
from s2c2a.robots import Robot
from s2c2a.runtime import Loop, StepRecord, StepRequest
from s2c2a.runtime.limits import TURN
from s2c2a.spaces import AXIS, Reading, Stage, States

# of the expected frequency
FROM = 0.2
TO = 2.5
FASTEST = 0.4  # of the control rate: below half of it
# of bend limits, and rad in all
SHARE = 0.1
MAX_TILT = 0.35
OF_LIMITS = 0.7  # of those of rate and acceleration
# periods of the expected mode: of a chirp, and of what is waited after it
WAVES = 30.0
REST = 6.0
FADE = 0.03  # of a chirp, at either end
# what shows how a tip swings, best first
SIGHT = "states", "configurations", "angular_velocities"
LACKING = (
    "nothing that this body says shows how it swings: it says {}. The response could be measured with inertial "
    "sensors (`accelerations`, `angular_velocities`), or with something that sees how the arm bends (`states`, "
    "`configurations`), at every control step; encoders and currents are before the cables' losses, cameras too slow"
)


class Shaken(NamedTuple):
    """What came of it, chirp by chirp, at every control step.

    Attributes:
        asked: bends that were asked for [rad], shape (2, steps, modules, 2): PCC of
            what was really sent.
        felt: bends by PCC of what the motors' encoders said [rad], the same shape;
            asked ones where they say nothing.
        seen: tilts of the tip towards x and y [rad], shape (2, steps, 2); NaN where
            nothing was seen.
        sight: name of the sensor that saw it.
    """

    asked: Float[np.ndarray, "chirps steps modules 2"]
    felt: Float[np.ndarray, "chirps steps modules 2"]
    seen: Float[np.ndarray, "chirps steps 2"]
    sight: str

    def tilts(self, towards: int) -> tuple[np.ndarray, np.ndarray]:
        """Asked and seen towards x (0) or y (1), of its own chirp [rad]."""
        return self.asked[towards, ..., towards].sum(axis=-1), self.seen[
            towards, :, towards
        ]


def chirp(arm: ArmSpec, frequency: float) -> Float[np.ndarray, "steps modules"]:
    """Bends [rad]: a wave from well below a frequency [Hz] to above it, as far as control steps show, then none.

    Small, no faster and no sharper than the arm may, and slower where that would be too
    little.
    """
    period = arm.control_period
    step = np.deg2rad(arm.step_limit_deg)
    turn = np.deg2rad(arm.acceleration_limit_deg or TURN * arm.step_limit_deg)
    high = min(TO * frequency, FASTEST / period)
    low = min(FROM * frequency, high / 4.0)
    shares = np.linspace(
        0.0,
        1.0,
        max(round(WAVES / frequency / period), round(WAVES / 3.0 / low / period)),
    )
    # of the wave in a step
    angles = 2.0 * np.pi * low * (high / low) ** shares * period
    sizes = SHARE * ArmGeometry.of(arm).bend_limits
    sizes *= min(1.0, MAX_TILT / sizes.sum())
    allowed = OF_LIMITS * np.minimum(step / angles, turn / angles**2)
    fade = np.minimum(1.0, np.minimum(shares, 1.0 - shares) / FADE)
    waves = (fade * np.sin(np.cumsum(angles)))[:, None] * np.minimum(
        sizes, allowed[:, None]
    )
    return np.concatenate(
        [waves, np.zeros((round(REST / frequency / period), arm.module_count))]
    )


def sight_of(robot: Robot) -> str:
    """The sensor that shows how a body swings.

    Raises:
        S2C2AError: none does; the message says which could.
    """
    for name in SIGHT:
        if name in robot.sensors:
            return name
    raise S2C2AError(LACKING.format(", ".join(robot.sensors) or "nothing"))


def shaken(
    robot: Robot,
    frequency: float,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Shaken:
    """Shake a body within its limits, and lead it to rest; on every way out, too.

    Args:
        robot: the body, not open yet.
        frequency: of its first mode, about [Hz].
        progress: told how many control steps of how many are done.

    Raises:
        S2C2AError: nothing shows how it swings, or a reading could not be believed; the
            arm is at rest.
    """
    arm = robot.arm
    sight = sight_of(robot)
    waves = chirp(arm, frequency)
    pcc = PCC.of(arm)
    bends = np.zeros((2, *waves.shape, 2))
    bends[0, ..., 0] = bends[1, ..., 1] = waves
    actions = np.asarray(
        pcc.actions(jnp.asarray(bends.reshape(-1, arm.module_count, 2), jnp.float32)),
        np.float64,
    )
    needed = (sight,) if robot.sensors[sight].always else ()
    with Loop(robot, Player(arm, needed, actions)) as loop:
        steps: list[StepRecord] = []
        for number in range(len(actions)):
            steps.append(loop.tick(StepRequest()))
            if steps[-1].stage is not Stage.RUN:
                raise S2C2AError(
                    f"the arm was held {steps[-1].moment - steps[0].moment:.1f} s on: {loop.fault}"
                )
            progress(number + 1, len(actions))
    halves = steps[: len(waves)], steps[len(waves) :]
    parts = zip(*(_chirp_of(half, arm, pcc, sight) for half in halves), strict=True)
    # late steps add some
    asked, felt, seen = (
        np.stack([part[: len(waves)] for part in chirps]) for chirps in parts
    )
    return Shaken(asked, felt, seen, sight)


def _chirp_of(
    steps: list[StepRecord], arm: ArmSpec, pcc: PCC, sight: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Asked and felt bends and seen tilts, at every control step: where one was left out, nothing was seen."""
    moments = np.array([step.moment for step in steps])
    places = np.maximum.accumulate(
        np.round((moments - moments[0]) / arm.control_period).astype(int)
    )
    sent = np.array([step.action for step in steps])
    said = [step.reading.get("cables") for step in steps]
    cables = [
        action if one is None else one
        for action, one in zip(np.roll(sent, 1, axis=0), said, strict=True)
    ]
    asked, felt = (
        np.asarray(pcc.bends(np.asarray(part, np.float32)), float)
        for part in (sent, cables)
    )
    held = np.searchsorted(places, np.arange(places[-1] + 1), side="right") - 1
    seen = np.full((len(held), 2), np.nan)
    seen[places] = tilts_of([step.reading for step in steps], arm, sight)
    return asked[held], felt[held], seen


def tilts_of(
    readings: list[Reading], arm: ArmSpec, sight: str
) -> Float[np.ndarray, "readings 2"]:
    """Tilts of the tip towards x and y [rad], base frame; NaN where nothing is said."""
    if sight == "angular_velocities":
        return _turned(readings)
    size = 6 if sight == "states" else 3
    none = np.full((arm.module_count, size), np.nan)
    said = np.array(
        [none if (one := reading.get(sight)) is None else one for reading in readings],
        float,
    )
    return tilts(said if sight == "states" else _states(said, arm))


def tilts(states: States) -> Float[np.ndarray, "*batch 2"]:
    """Of the tip: the angle of its axis with z, times its direction [rad]."""
    axis = states[..., -1, AXIS]
    across = np.linalg.norm(axis[..., :2], axis=-1, keepdims=True)
    return axis[..., :2] * np.arctan2(across, axis[..., 2:]) / np.maximum(across, 1e-12)


def _states(configurations: np.ndarray, arm: ArmSpec) -> States:
    numbers = (
        jnp.asarray(part, jnp.float32)
        for part in (configurations, ArmGeometry.of(arm).lengths)
    )
    return np.asarray(states_from_configurations(*numbers), np.float64)


def _turned(readings: list[Reading]) -> Float[np.ndarray, "readings 2"]:
    """By how much an inertial sensor at the tip has turned; its zero makes that drift, which a fit takes off.

    An arm that tilts towards x turns about y, and one that tilts towards y the other
    way about x.
    """
    said = [reading.get("angular_velocities") for reading in readings]
    rates = np.array(
        [[np.nan] * 3 if one is None else np.mean(one[:, -1], axis=0) for one in said]
    )
    times = np.array([reading.time for reading in readings])
    lost = ~np.isfinite(rates).all(axis=-1)
    ways = (
        np.nan_to_num(rates[:, [1, 0]] * [1.0, -1.0])
        * np.diff(times, prepend=times[0])[:, None]
    )
    return np.where(lost[:, None], np.nan, np.cumsum(ways, axis=0))
