"""Simulated robots that advance together, in one call of MuJoCo.

What `SimulatedRobot.advance` does for one robot, this does for many, with the same
functions and the same numbers. It computes only what the next step and an observation
need: no accelerations, and tensions and bend angles only for cables with friction.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence

from s2c2a.robots.simulation import SimulatedRobot  # isort: skip  # safe start of MuJoCo
import mujoco
import numpy as np
from jaxtyping import Bool, Float
from mujoco.rollout import Rollout

from s2c2a.arm.geometry import cables_present
from s2c2a.robots.simulation.transmission import (
    CableTransmission,
    compute_motor_path,
    read_cables,
)
from s2c2a.spaces import Actions, States

STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS
TIME = 0  # place of the time in such a state; the joint positions follow
PLACES = (mujoco.mj_kinematics,)
TENSIONS = (mujoco.mj_fwdPosition, mujoco.mj_fwdVelocity, mujoco.mj_fwdActuation)


class Lockstep:
    """Robots of one arm, or of arms that differ in numbers only, with equal steps.

    Args:
        robots: open, without events.
        rollout: of MuJoCo, with its threads.
    """

    def __init__(self, robots: Sequence[SimulatedRobot], rollout: Rollout):
        first = robots[0]
        self._robots = robots
        self._models = [robot.model for robot in robots]
        self._times = first.physics_times(first.arm.control_period)
        self._motor = first.arm.motor
        self._present = cables_present(first.arm)
        self._rollout = rollout
        threads = max(1, rollout.nthread)
        self._scratch = [mujoco.MjData(first.model) for _ in range(threads)]
        transmissions = [robot.transmission for robot in robots]
        self._transmission = CableTransmission.stack(transmissions)
        self._stages = TENSIONS if self._transmission.has_friction else PLACES

    def advance(
        self, commands: Actions, forces: Float[np.ndarray, "arms 3"]
    ) -> Bool[np.ndarray, " arms"]:
        """Advance by one control step; returns which simulations diverged.

        Those diverge again in every later step.

        Args:
            commands: within the limits [m, N or Pa], shape (arms, modules, cables).
            forces: at the tips [N], base frame.
        """
        controls = self._move_motors(commands)
        inputs = controls
        kind = mujoco.mjtState.mjSTATE_CTRL
        if forces.any():
            for robot, force in zip(self._robots, forces, strict=True):
                robot.apply_force(force)
            wrenches = [robot.tip_wrenches().ravel() for robot in self._robots]
            once = np.array(wrenches)[:, None]
            repeated = np.repeat(once, len(self._times), axis=1)
            kind = kind | mujoco.mjtState.mjSTATE_XFRC_APPLIED
            inputs = np.concatenate([controls, repeated], axis=-1)
        size = mujoco.mj_stateSize(self._models[0], STATE)
        starts = np.empty((len(self._robots), size))
        for robot, state in zip(self._robots, starts, strict=True):
            mujoco.mj_getState(robot.model, robot.data, state, STATE)
        path = np.empty((len(starts), len(self._times), starts.shape[1]))
        self._rollout.rollout(
            self._models,
            self._scratch,
            starts,
            inputs,
            control_spec=int(kind),
            nstep=len(self._times),
            skip_checks=True,
            state=path,
        )
        ends = path[:, -1]
        for number, robot in enumerate(self._robots):
            self._take(robot, starts[number], ends[number], controls[number, -1])
        # a rollout that diverges repeats the state where it stops
        duration = self._times[-1] - self._times[0] / 2
        last_step = starts[:, TIME] + duration
        is_known = np.isfinite(ends).all(axis=-1)
        has_arrived = ends[:, TIME] > last_step
        return ~(is_known & has_arrived)

    def measure_cables(self) -> Actions:
        """Measurements of the cables, as `SimulatedRobot.measure_cables`."""
        motors = np.array([robot.motors for robot in self._robots])
        noise = np.array([robot.sample_noise() for robot in self._robots])
        return read_cables(self._robots[0].arm, motors, noise)

    def states(self) -> States:
        """True states [m, 1], base frame, shape (arms, modules, 6)."""
        positions = np.array([robot.data.site_xpos for robot in self._robots])
        matrices = np.array([robot.data.site_xmat for robot in self._robots])
        ends = self._robots[0].end_sites
        # the third column of each matrix
        axes = matrices[:, ends, 2::3]
        return np.concatenate([positions[:, ends], axes], axis=-1)

    def _move_motors(self, commands: Actions) -> Float[np.ndarray, "arms times cables"]:
        """Move the motors; returns the commands of the actuators at the modules."""
        motors = np.array([robot.motors for robot in self._robots])
        errors = np.array([robot.homing_errors for robot in self._robots])
        path = compute_motor_path(motors, commands, self._times, self._motor)
        # friction depends on tensions [N] and bend angles [rad]
        tensions = np.zeros((len(self._robots), *self._present.shape))
        angles = tensions[..., 0]
        if self._transmission.has_friction:
            tensions = np.array([robot.tensions() for robot in self._robots])
            angles = np.array([robot.bend_angles() for robot in self._robots])
        transmitted = self._transmission.transmit(
            path + errors, self._times, tensions, angles
        )
        losses = self._transmission
        for number, robot in enumerate(self._robots):
            robot.motors = path[-1, number]
            robot.transmission.transmitted = losses.transmitted[number]
            robot.transmission.crept = losses.crept[number]
        return np.ascontiguousarray(transmitted[..., self._present].swapaxes(0, 1))

    def _take(
        self,
        robot: SimulatedRobot,
        start: np.ndarray,
        end: np.ndarray,
        control: Float[np.ndarray, " cables"],
    ) -> None:
        """Bring a robot from the state of the last step to its next one."""
        mujoco.mj_setState(robot.model, robot.data, end, STATE)
        positions = start[TIME + 1 : TIME + 1 + robot.model.nq]
        robot.relax(positions, self._times[-1])
        if self._transmission.has_friction:
            robot.data.ctrl = control
        for compute in self._stages:
            compute(robot.model, robot.data)


def in_lockstep(
    robots: Mapping[int, SimulatedRobot], rollout: Rollout
) -> dict[tuple[int, ...], Lockstep]:
    """Group robots of one kind by their physics step, by their numbers."""
    groups = defaultdict(list)
    for number, robot in robots.items():
        groups[robot.model.opt.timestep].append(number)
    return {
        tuple(numbers): Lockstep([robots[number] for number in numbers], rollout)
        for numbers in groups.values()
    }
