"""The simulated arm as a robot."""

import mujoco
import numpy as np
from jaxtyping import Float
from mujoco.rollout import Rollout

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.errors import S2C2AError, SimulationError
from s2c2a.robots.robot import Robot, checked_action
from s2c2a.robots.simulation.cables import CableTransmission
from s2c2a.robots.simulation.chain import build_model
from s2c2a.robots.simulation.fidelity import fidelity_named
from s2c2a.robots.simulation.motors import encoder_reading, follow
from s2c2a.spaces import Actions, Reading, States

SETTLING_TIME = 1.0  # s at rest before the clock starts
MOST_PAYLOAD = 50.0  # kg
_PHYSICS = mujoco.mjtState.mjSTATE_FULLPHYSICS


class SimulatedRobot(Robot):
    """An arm in MuJoCo whose clock is the simulation's own.

    Args:
        arm: the description.
        fidelity: "fast" or "accurate".
        seed: of the sensor noise; the physics is deterministic.
        payload: mass at the tip [kg].
        jitter: part of the full bend that every module is moved by, in a random direction, before it settles at rest;
            cables with hysteresis then start in another state.
        watched: whether readings tell the centre line at every physics step; it costs a little time.

    Raises:
        S2C2AError: unknown fidelity, impossible payload.
    """

    def __init__(
        self,
        arm: ArmSpec,
        fidelity: str = "fast",
        seed: int = 0,
        payload: float = 0.0,
        jitter: float = 0.0,
        watched: bool = False,
    ):
        self.arm, self._fidelity = arm, fidelity_named(fidelity)
        self.model = build_model(arm, self._fidelity, _checked_payload(payload))
        self.data = mujoco.MjData(self.model)
        self._rollout = Rollout(nthread=0)
        self._geometry = ArmGeometry.of(arm)
        self._seed, self._jitter = seed, jitter
        self._base_sites = [self.model.site(f"base_{module}").id for module in range(arm.module_count)]
        self._end_sites = [self.model.site(f"end_{module}").id for module in range(arm.module_count)]
        self._centre_sites = self._sites_named("centre_")
        self._watched = watched
        self._seen: list[np.ndarray] = []
        self._tip_body = self.model.site_bodyid[self._end_sites[-1]]
        self._motors: Actions
        self._transmission: CableTransmission
        self._last_states: States | None
        self._rest()

    def open(self) -> Reading:
        """Go to rest, settle for one second, and start the clock at zero."""
        mujoco.mj_resetData(self.model, self.data)
        self._rest()
        self.send(self._jittered())
        for _ in range(max(1, int(np.ceil(SETTLING_TIME * self.arm.control_rate)))):
            self.send(self._geometry.action_neutral)
        self.data.time, self._step = 0.0, 0
        return self.read()

    def read(self) -> Reading:
        """What the sensors say now, and the truth beside it.

        Raises:
            SimulationError: the simulated arm blew up before; open it again.
        """
        self._check_sane()
        line = np.array(self._seen) if self._seen else None
        return Reading(self.data.time, self._measured_cables(), self.states(), self.configurations(), line)

    def send(self, action: Actions) -> Actions:
        """Hold an action for one control step; see `Robot.send`.

        Raises:
            ActionError: wrong shape or not finite; nothing has moved.
            SimulationError: the simulated arm blew up.
        """
        sent = checked_action(action, self._geometry)
        self._check_sane()
        times = self._physics_times()
        path = follow(self._motors, sent, times, self.arm.motor)
        felt = self._transmission.pass_on(path, times, self.tensions(), self._bend_angles())
        self._motors = path[-1]
        self._seen = []
        self._advance(felt.reshape(len(felt), -1))
        mujoco.mj_forward(self.model, self.data)
        self._watch()
        self._step += 1
        self._check_sane()
        self._last_states = self.states()
        return sent

    def close(self) -> None:
        """Nothing to leave behind."""

    def push(self, force: Float[np.ndarray, "3"]) -> None:
        """Apply a force at the tip [N], base frame, from now until the next call or `open`.

        Raises:
            S2C2AError: not three finite numbers.
        """
        values = np.asarray(force, dtype=float)
        if values.shape != (3,) or not np.isfinite(values).all():
            raise S2C2AError(f"a push takes three finite numbers [N], got {force}")
        self._push = values

    def load(self, payload: float) -> None:
        """Hang a mass at the tip [kg] in place of the last one, from now on; the arm does not jump.

        Raises:
            S2C2AError: impossible payload.
        """
        model = build_model(self.arm, self._fidelity, _checked_payload(payload))
        data, kind = mujoco.MjData(model), mujoco.mjtState.mjSTATE_INTEGRATION
        state = np.empty(mujoco.mj_stateSize(model, kind))
        mujoco.mj_getState(self.model, self.data, state, kind)
        mujoco.mj_setState(model, data, state, kind)
        mujoco.mj_forward(model, data)
        self.model, self.data = model, data

    def states(self) -> States:
        """True states, shape (modules, 6), base frame."""
        positions = self.data.site_xpos[self._end_sites]
        return np.concatenate([positions, self._axes(self._end_sites)], axis=-1)

    def configurations(self) -> Float[np.ndarray, "modules 3"]:
        """True configurations: end axes in the frames of the modules' bases, shape (modules, 3)."""
        bases = self.data.site_xmat[self._base_sites].reshape(-1, 3, 3)
        return np.einsum("mij,mi->mj", bases, self._axes(self._end_sites))

    def tensions(self) -> Float[np.ndarray, "modules cables"]:
        """Tensions at the modules [N], shape (modules, cables)."""
        return -self.data.actuator_force.reshape(self._geometry.action_neutral.shape)

    def _jittered(self) -> Actions:
        """An action a little off neutral, in a random direction of every module."""
        angles = np.random.default_rng([self._seed, 1]).uniform(0, 2 * np.pi, self.arm.module_count)
        shares = self._jitter * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        bends = np.einsum("mck,mk->mc", self._geometry.cable_matrices, shares)
        return self._geometry.action_neutral + self._geometry.action_scale[:, None] * bends

    def _sites_named(self, start: str) -> list[int]:
        names = [self.model.site(number).name for number in range(self.model.nsite)]
        return [number for number, name in enumerate(names) if name.startswith(start)]

    def _watch(self) -> None:
        """Remember the centre line; in `mj_step` positions are those of the step's start."""
        if self._watched:
            self._seen.append(self.data.site_xpos[self._centre_sites])

    def _rest(self) -> None:
        self._random = np.random.default_rng(self._seed)
        self._motors = self._geometry.action_neutral.copy()
        self._transmission = CableTransmission(self.arm, self._geometry.action_neutral)
        self._step, self._last_states = 0, None
        self._push = np.zeros(3)
        mujoco.mj_forward(self.model, self.data)

    def _physics_times(self) -> Float[np.ndarray, " times"]:
        """Ends of the physics steps of one control step [s], from its start."""
        step = self.model.opt.timestep
        return step * np.arange(1, round(self.arm.control_period / step) + 1)

    def _advance(self, commands: Float[np.ndarray, "times cables"]) -> None:
        """One physics step for every command: in one call, since Python between them costs as much as they do."""
        if self._watched:
            self.data.xfrc_applied[self._tip_body] = self._wrench()
            for command in commands:
                self.data.ctrl[:] = command
                mujoco.mj_step(self.model, self.data)
                self._watch()
            return
        inputs, values = mujoco.mjtState.mjSTATE_CTRL, commands
        if self._push.any():
            inputs = inputs | mujoco.mjtState.mjSTATE_XFRC_APPLIED
            wrenches = np.zeros_like(self.data.xfrc_applied)
            wrenches[self._tip_body] = self._wrench()
            values = np.hstack([commands, np.tile(wrenches.ravel(), (len(commands), 1))])
        state = np.empty((1, mujoco.mj_stateSize(self.model, _PHYSICS)))
        mujoco.mj_getState(self.model, self.data, state[0], _PHYSICS)
        self._rollout.rollout(
            [self.model],
            [self.data],
            state,
            values[None],
            control_spec=int(inputs),
            nstep=len(values),
            skip_checks=True,
        )

    def _wrench(self) -> Float[np.ndarray, "6"]:
        """The push, and its torque: MuJoCo applies forces at centres of mass, this one is at the tip."""
        lever = self.data.site_xpos[self._end_sites[-1]] - self.data.xipos[self._tip_body]
        return np.concatenate([self._push, np.cross(lever, self._push)])

    def _axes(self, sites: list[int]) -> Float[np.ndarray, "modules 3"]:
        return self.data.site_xmat[sites].reshape(-1, 3, 3)[:, :, 2]

    def _bend_angles(self) -> Float[np.ndarray, " modules"]:
        configurations = self.configurations()
        return np.arctan2(np.linalg.norm(configurations[:, :2], axis=-1), configurations[:, 2])

    def _measured_cables(self) -> Actions:
        if self.arm.actuation == "displacement":
            return encoder_reading(self._motors, self.arm.motor, self._random)
        return self._motors + self._random.normal(scale=self.arm.motor.noise_tension, size=self._motors.shape)

    def _check_sane(self) -> None:
        bad = self.data.warning.number.any()  # after any of them a rollout goes no further
        if bad or not (np.isfinite(self.data.qpos).all() and np.isfinite(self.data.qvel).all()):
            raise SimulationError(
                f"{self.arm.name}: the simulation blew up in control step {self._step}, at {self.data.time:.2f} s; "
                "give the modules more mass or damping, or softer cables; then open it again",
                self._step,
                self._last_states,
            )


def _checked_payload(payload: float) -> float:
    if not (np.isfinite(payload) and 0 <= payload <= MOST_PAYLOAD):
        raise S2C2AError(f"payload {payload} kg is not between 0 and {MOST_PAYLOAD:g} kg")
    return payload
