"""The simulator's chain compared with a Cosserat rod in SoRoSim: shapes and vibration.

    python benchmarks/sorosim.py FOLDER [--segments 20]

FOLDER holds `statics_tpu.csv.gz` and `dynamics_tpu_1..5.txt.gz` of
ContinuumRoboticsLab/opencr-mujoco (MIT), `data/reference/sorosim`. The rod of
thermoplastic polyurethane points along x there and along z here; wrenches are in the
base frame and act at its middle and tip. What is called a damping ratio in the files is
damping over stiffness [s].
"""

import argparse
import gzip
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from jaxtyping import Float
from pydantic import BaseModel
from scipy.optimize import least_squares

from s2c2a.arm import ArmSpec, Module
from s2c2a.robots.simulation.chain import Fidelity, build_model

# m, m, kg/m3, Pa, 1
LENGTH = 0.4
RADIUS = 0.005
DENSITY = 1200.0
YOUNG = 70e6
POISSON = 0.4
SEGMENTS = 20
RELEASES = 5
# their x is along the rod; turn their vectors into our frame
TO_OURS = np.array([[0, 0, 1], [0, -1, 0], [1, 0, 0]])
# Newton; rad
LOAD_SHARES = (0.25, 0.5, 0.75, 1.0)
MAX_STEPS = 30
LARGEST_STEP = 0.3
SLOPE_STEP = 1e-6
CLOSE = 1e-9
# s: of the files, of the physics, when only the first mode is left
PERIOD = 0.005
TIME_STEP = 0.0005
LATE = 4.0


@dataclass(frozen=True, eq=False)
class Shape:
    """The rod at rest: gravity, wrench [N, N m] and positions [m] of middle and tip."""

    gravity: Float[np.ndarray, "3"]
    moments: Float[np.ndarray, "2 3"]
    forces: Float[np.ndarray, "2 3"]
    places: Float[np.ndarray, "2 3"]


@dataclass(frozen=True, eq=False)
class Release:
    """A released rod: damping over stiffness [s], positions of middle and tip [m]."""

    held: Shape
    damping_time: float
    places: Float[np.ndarray, "times 2 3"]


def read_shapes(path: Path) -> list[Shape]:
    """Every static shape of a file."""
    with gzip.open(path, "rt") as file:
        rows = [line.split(",")[1:] for line in file.readlines()[2:]]
    # (shapes, angles and places, columns)
    blocks = np.array(rows, float).reshape(-1, 6, 17)
    return [
        _shape(block[3:, 0], block[:, 1:3].T, block[3:, [9, 16]].T) for block in blocks
    ]


def read_release(path: Path) -> Release:
    """One free vibration."""
    with gzip.open(path, "rt") as file:
        head, wrenches, *rows = (np.array(line.split(), float) for line in file)
    table = np.array(rows)
    places = np.stack([table[:, 4:7], table[:, 10:13]], axis=1)
    held = _shape(head[-3:], wrenches[1:].reshape(2, 6), places[0])
    return Release(held, float(head[0]), places @ TO_OURS.T)


def _shape(gravity: np.ndarray, wrenches: np.ndarray, places: np.ndarray) -> Shape:
    turned = [
        values @ TO_OURS.T
        for values in (gravity, wrenches[:, :3], wrenches[:, 3:], places)
    ]
    return Shape(turned[0] / np.linalg.norm(turned[0]), *turned[1:])


def rod(
    gravity: Float[np.ndarray, "3"],
    segments: int = SEGMENTS,
    damping_time: float = 0.05,
) -> mujoco.MjModel:
    """The rod as an arm of two modules without cable tensions."""
    area = np.pi * RADIUS**2
    bending = YOUNG * np.pi * RADIUS**4 / 4
    half = Module(
        length=LENGTH / 2,
        cable_radius=RADIUS,
        cable_angles_deg=(0, 120, 240),
        mass=DENSITY * area * LENGTH / 2,
        bending_stiffness=bending,
        torsional_stiffness=bending / (1 + POISSON),  # GJ of a round rod
        tension_range=1,
    )
    # beside the limits of arm files, which begin at 5 ms; these rods are at 3 to 5
    half = BaseModel.model_copy(half, update={"damping_time": damping_time})
    arm = ArmSpec(
        name="rod",
        actuation="tension",
        gravity_direction=tuple(gravity),
        modules=(half, half),
    )
    layout = Fidelity(
        segments // 2,
        True,
        False,
        time_step=TIME_STEP,
        explicit_time_step=TIME_STEP,
    )
    return build_model(arm, layout)


def rest(model: mujoco.MjModel, shape: Shape) -> mujoco.MjData:
    """The chain at rest under a shape's loads, by Newton's method with load steps."""
    data = mujoco.MjData(model)
    gravity = model.opt.gravity.copy()
    for share in LOAD_SHARES:
        model.opt.gravity = share * gravity
        for _ in range(MAX_STEPS):
            step = _newton_step(model, data, share, shape)
            data.qpos += step
            if np.abs(step).max() < CLOSE:
                break
    model.opt.gravity = gravity
    mujoco.mj_forward(model, data)
    return data


def _newton_step(
    model: mujoco.MjModel, data: mujoco.MjData, share: float, shape: Shape
) -> np.ndarray:
    """Newton iterations to equilibrium with steps of at most LARGEST_STEP."""
    start = data.qpos.copy()

    def unbalanced(joints):
        data.qpos[:] = joints
        return _joint_forces(model, data, share, shape)

    forces = unbalanced(start)
    slopes = (
        np.array(
            [
                unbalanced(start + step) - forces
                for step in SLOPE_STEP * np.eye(model.nv)
            ]
        ).T
        / SLOPE_STEP
    )
    data.qpos[:] = start
    step = -np.linalg.solve(slopes, forces)
    return step * min(1.0, LARGEST_STEP / np.abs(step).max())


def _joint_forces(
    model: mujoco.MjModel, data: mujoco.MjData, share: float, shape: Shape
) -> np.ndarray:
    """Joint torques of springs, gravity and a fraction of the wrenches [N m]."""
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fwdVelocity(model, data)
    forces = data.qfrc_passive - data.qfrc_bias
    for site, force, moment in zip(
        ("end_0", "end_1"), shape.forces, shape.moments, strict=True
    ):
        along, about = np.zeros((2, 3, model.nv))
        mujoco.mj_jacSite(model, data, along, about, model.site(site).id)
        forces = forces + share * (along.T @ force + about.T @ moment)
    return forces


def static_error(shape: Shape, segments: int = SEGMENTS) -> float:
    """Distance of the chain's tip to the rod's [m]."""
    return float(
        np.linalg.norm(
            _places(rest(rod(shape.gravity, segments), shape))[1] - shape.places[1]
        )
    )


def _places(data: mujoco.MjData) -> np.ndarray:
    return np.array([data.site("end_0").xpos, data.site("end_1").xpos])


def vibration(
    release: Release, segments: int = SEGMENTS
) -> Float[np.ndarray, "times 2 3"]:
    """Middle and tip of the chain [m] at the release's times."""
    model = rod(release.held.gravity, segments, release.damping_time)
    data = rest(model, release.held)
    places = []
    for _ in release.places:
        places.append(_places(data))
        mujoco.mj_step(model, data, round(PERIOD / TIME_STEP))
    return np.array(places)


def first_mode(places: Float[np.ndarray, "times 2 3"]) -> tuple[float, float]:
    """Frequency [Hz] and damping ratio of the tip's late vibration, a fitted sine."""
    tip = places[round(LATE / PERIOD) :, 1]
    times = PERIOD * np.arange(len(tip))

    def residual(rates):
        decay = np.exp(-rates[1] * times)
        turn = rates[0] * times
        basis = np.stack(
            [decay * np.cos(turn), decay * np.sin(turn), np.ones_like(times)], axis=1
        )
        return (basis @ np.linalg.lstsq(basis, tip)[0] - tip).ravel()

    turning, decaying = least_squares(
        residual, [_loudest(tip), 0.3], x_scale=[0.1, 0.1]
    ).x
    natural = np.hypot(turning, decaying)
    return float(natural / (2 * np.pi)), float(decaying / natural)


def _loudest(tip: np.ndarray) -> float:
    """Where the spectrum peaks [rad/s]."""
    power = np.sum(np.abs(np.fft.rfft(tip - tip.mean(axis=0), axis=0)) ** 2, axis=1)
    return 2 * np.pi * np.fft.rfftfreq(len(tip), PERIOD)[np.argmax(power)]


def main() -> None:
    """Print both comparisons."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--segments", type=int, default=SEGMENTS)
    given = parser.parse_args()
    errors = np.array(
        [
            static_error(one, given.segments)
            for one in read_shapes(given.folder / "statics_tpu.csv.gz")
        ]
    )
    print(
        f"{len(errors)} shapes, {given.segments} segments: "
        f"tip error mean {1e3 * errors.mean():.2f} mm, ",
        end="",
    )
    print(
        f"95 % {1e3 * np.percentile(errors, 95):.2f}, "
        f"largest {1e3 * errors.max():.2f}; ",
        end="",
    )
    print(f"{(errors <= 0.01 * LENGTH).mean():.1%} within 1 % of the length")
    for number in range(1, RELEASES + 1):
        release = read_release(given.folder / f"dynamics_tpu_{number}.txt.gz")
        _tell_vibration(number, release, vibration(release, given.segments))


def _tell_vibration(number: int, release: Release, ours: np.ndarray) -> None:
    (there, there_damped) = first_mode(release.places)
    (here, here_damped) = first_mode(ours)
    apart = 1e3 * np.linalg.norm(ours[:, 1] - release.places[:, 1], axis=-1)
    print(
        f"release {number}: first mode {there:.3f} Hz there, "
        f"{here:.3f} here ({here / there - 1:+.2%}), ",
        end="",
    )
    print(
        f"damping ratio {there_damped:.4f} and {here_damped:.4f}; "
        f"tips apart {np.sqrt(np.mean(apart**2)):.2f} mm rms"
    )


if __name__ == "__main__":
    main()
