"""How much the loop bears: by how much more an arm may answer, and how much later, before it swings for ever.

The loop of observer, plan and calming is linear for small motions about rest. Its
margins are those of the worst load of the table (`gains.LOADS`), with all sensors that
see the swing or the lean.
"""

from dataclasses import dataclass, replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.linalg import block_diag

from s2c2a.arm import ArmSpec
from s2c2a.estimation.gains import REACH, riccati
from s2c2a.estimation.observer import Observer
from s2c2a.estimation.sensors import Shape
from s2c2a.kinematics.chain import states_from_bends
from s2c2a.models.trunk import Trunk

# what is looked for
MAX_GAIN = 8.0
MAX_DELAY = 8
CAUTION = 1.0, 1.5, 2.0, 3.0, 5.0, 8.0, 12.0, 20.0, 40.0, 80.0
CARRIED = 0.8  # of the arm's mass: loads that margins are promised for
MAX_LATE = 64  # steps


@dataclass(frozen=True)
class Margins:
    """Of a loop.

    Attributes:
        gain: by which factor the arm may answer more than expected.
        delay: by how many control steps later; whole ones.
    """

    gain: float
    delay: int

    def __str__(self) -> str:
        """In words."""
        most = "or more" if self.gain >= MAX_GAIN else ""
        return f"it may answer {self.gain:.1f} times as much {most} and {self.delay} steps later".replace(
            "  ", " "
        )


AT_ONCE = -1
PROMISED = Margins(2.0, 1)


@dataclass(frozen=True)
class _Loop:
    """The linear loop about rest, under one load; bends are n numbers.

    Attributes:
        steps: A of the swing.
        inputs: B.
        calming: gains.
        slopes: of what is seen by bends, shape (numbers, n).
        late: by how many steps each number is told late; `AT_ONCE` where it tells of
            the swing.
        spread: standard deviations of what is seen.
        zeros: of what is seen by zeros of sensors, shape (numbers, zeros).
        noise: variance that a step adds to leans, bends, rates and zeros.
        kept: part of leans that is not forgotten in a step.
    """

    steps: np.ndarray
    inputs: np.ndarray
    calming: np.ndarray
    slopes: np.ndarray
    late: np.ndarray
    spread: np.ndarray
    zeros: np.ndarray
    noise: np.ndarray
    kept: float


def margins_of(arm: ArmSpec, observer: Observer) -> Margins:
    """Of an arm that is watched so; without any sense there is no loop, and nothing that could swing."""
    loops = [_loop(arm, observer, number) for number in _judged(observer)]
    if not loops:
        return Margins(MAX_GAIN, MAX_DELAY)
    return Margins(min(map(_gain_margin, loops)), min(map(_delay_margin, loops)))


def with_margins(arm: ArmSpec, observer: Observer) -> Observer:
    """The same observer, so cautious with each load that its loop has the margins that are promised.

    Loads under which none is enough are heavier than the arm can carry upright; there
    it is as cautious as can be.
    """
    caution = np.asarray(observer.gains.caution, float).copy()
    for number in range(len(caution)) if observer.sensors else ():
        loop = _loop(arm, observer, number)
        enough = (
            factor
            for factor in CAUTION
            if _has_margins(replace(loop, spread=factor * loop.spread))
        )
        caution[number] = caution[number] * next(enough, CAUTION[-1])
    gains = observer.gains._replace(caution=jnp.asarray(caution, jnp.float32))
    return eqx.tree_at(lambda one: one.gains, observer, gains)


def _judged(observer: Observer) -> list[int]:
    """Loads that margins are promised for."""
    within = np.asarray(observer.gains.loads) <= CARRIED * observer.mass
    return (
        [number for number, inside in enumerate(within) if inside]
        if observer.sensors
        else []
    )


def _has_margins(loop: _Loop) -> bool:
    filtering = _filter_gain(loop)
    return _stable(loop, filtering, PROMISED.gain, 0) and _stable(
        loop, filtering, 1.0, PROMISED.delay
    )


_off = eqx.filter_jit(lambda sense, said, shape: sense.off(said, shape))


def _loop(arm: ArmSpec, observer: Observer, number: int) -> _Loop:
    """Of a straight arm that is taut, under one load of the table."""
    straight = jnp.zeros((arm.module_count, 2))
    none = jnp.zeros((observer.history, arm.module_count, 2))
    states = jnp.broadcast_to(
        states_from_bends(straight, Trunk.of(arm).lengths),
        (len(none), arm.module_count, 6),
    )
    shape = Shape(
        straight,
        straight,
        jnp.full((arm.module_count, arm.cable_count), jnp.inf),
        none,
        states,
        none,
    )
    lagging = [sense.lagging(straight) for sense in observer.sensors]
    seen = [
        _off(sense, sense.silent(), shape._replace(lagging=lags))
        for sense, lags in zip(observer.sensors, lagging, strict=True)
    ]
    late = [
        min(int(np.ceil(sense.late)), MAX_LATE) if sense.slow else AT_ONCE
        for sense in observer.sensors
    ]
    caution = float(observer.gains.caution[number])
    zeros = [
        np.eye(len(off.numbers), len(sense.zeros.first))
        for off, sense in zip(seen, observer.sensors, strict=True)
    ]
    return _Loop(
        steps=np.asarray(observer.gains.steps[number], float),
        inputs=np.asarray(observer.gains.inputs[number], float),
        calming=np.asarray(observer.gains.calming[number], float) * observer.calming,
        slopes=np.concatenate([np.asarray(off.slopes, float) for off in seen]),
        late=np.repeat(late, [len(off.numbers) for off in seen]),
        spread=caution
        * np.concatenate([np.asarray(off.spread, float) for off in seen]),
        zeros=block_diag(*zeros),
        noise=np.asarray(
            observer.noise(2 * arm.module_count, float(observer.gains.loads[number])),
            float,
        )[1:],
        kept=observer.kept,
    )


def _filter_gain(loop: _Loop) -> Float[np.ndarray, "states numbers"]:
    """What stands after many steps."""
    count = loop.inputs.shape[1]
    (numbers, zeros) = loop.zeros.shape
    change = np.eye(3 * count + zeros)
    change[:count, :count] = loop.kept * np.eye(count)
    change[count : 3 * count, : 3 * count] = np.hstack(
        [loop.inputs * loop.kept, loop.steps]
    )
    seen = np.hstack([np.zeros((numbers, 3 * count)), loop.zeros])
    seen[:, count : 2 * count] = np.where(
        loop.late[:, None] == AT_ONCE, loop.slopes, 0.0
    )
    seen[:, :count] = np.where(loop.late[:, None] != AT_ONCE, loop.slopes, 0.0)
    noise = np.diag(loop.noise)
    spread = np.diag(loop.spread**2)
    covariance = riccati(change.T, seen.T, noise, spread)
    return np.linalg.solve(seen @ covariance @ seen.T + spread, seen @ covariance).T


def _stable(loop: _Loop, filtering: np.ndarray, gain: float, delay: int) -> bool:
    """Whether the loop comes to rest, of an arm that answers so much more, and so many steps later."""
    n = loop.inputs.shape[1]
    steps = int(max(loop.late.max() + 1, 1))
    # arm, commands on their way, leans, expected, past, zeros
    sizes = [2 * n, (delay + 1) * n, n, 2 * n, steps * n, loop.zeros.shape[1]]
    ends = np.cumsum(sizes)

    def step(z: np.ndarray) -> np.ndarray:
        arm, queue, leans, expected, past, zeros = np.split(z, ends[:-1])
        arm = loop.steps @ arm + loop.inputs @ (gain * queue[-n:])
        leans = loop.kept * leans
        rests = queue[:n] + leans
        expected = loop.steps @ expected + loop.inputs @ rests
        thought = expected[:n] if (loop.late == AT_ONCE).any() else rests
        # where it was beside what encoders tell
        past = np.concatenate([arm[:n] - thought + leans, past[:-n]])
        missed = past.reshape(steps, n)[np.maximum(loop.late, 0)] - leans
        seen = np.where(loop.late[:, None] == AT_ONCE, arm[:n] - expected[:n], missed)
        change = filtering @ (
            np.einsum("ij,ij->i", loop.slopes, seen) - loop.zeros @ zeros
        )
        leans = leans + change[:n]
        expected = expected + change[n : 3 * n]
        zeros = zeros + change[3 * n :]
        asked = -loop.calming @ expected
        return np.concatenate(
            [arm, REACH * asked - leans, queue[:-n], leans, expected, past, zeros]
        )

    whole = np.stack([step(unit) for unit in np.eye(ends[-1])], axis=1)
    return bool(np.abs(np.linalg.eigvals(whole)).max() < 1.0)


def _gain_margin(loop: _Loop) -> float:
    """To a twentieth."""
    filtering = _filter_gain(loop)
    if not _stable(loop, filtering, 1.0, 0):
        return 0.0
    low = 1.0
    high = MAX_GAIN
    if _stable(loop, filtering, high, 0):
        return high
    while high - low > 0.05:
        middle = (low + high) / 2.0
        low, high = (
            (middle, high) if _stable(loop, filtering, middle, 0) else (low, middle)
        )
    return low


def _delay_margin(loop: _Loop) -> int:
    filtering = _filter_gain(loop)
    return next(
        (
            delay
            for delay in range(MAX_DELAY)
            if not _stable(loop, filtering, 1.0, delay + 1)
        ),
        MAX_DELAY,
    )
