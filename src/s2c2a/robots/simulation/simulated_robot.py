"""The simulated arm as a robot."""

import mujoco
import numpy as np
from jaxtyping import Float
from mujoco.rollout import Rollout

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.arm.geometry import per_cable, per_module
from s2c2a.errors import S2C2AError, SimulationError
from s2c2a.robots.robot import Robot, checked_action
from s2c2a.robots.simulation.extra_sensors import Beside, Currents, sensed_beside
from s2c2a.robots.simulation.chain import build_model, fidelity_named
from s2c2a.robots.simulation.declared_sensors import declared_sensors
from s2c2a.robots.simulation.events import MAX_PAYLOAD, EventSchedule, parse_events
from s2c2a.robots.simulation.relaxation import Relaxation
from s2c2a.robots.simulation.stepping import stepped, taken_over
from s2c2a.robots.simulation.transmission import (
    CableTransmission,
    encoder_reading,
    motor_path,
)
from s2c2a.robots.simulation.twin import twin_of
from s2c2a.spaces import CENTER_LINE_POINTS, Actions, Reading, Sensor, States

SETTLING_TIME = 1.0  # s at rest before the clock starts


class SimulatedRobot(Robot):
    """An arm in MuJoCo whose clock is the simulation's own, and moves in `advance`.

    Args:
        arm: the description.
        fidelity: "fast" or "accurate".
        seed: of the sensor noise and of homing errors; the physics is deterministic.
        payload: mass at the tip [kg].
        jitter: part of the full bend that every module is moved by, in a random
            direction, before it settles at rest; cables with hysteresis then start in
            another state.
        watched: whether readings tell the center line at every physics step; it costs a
            little time.
        aged: how far it has gone on its way to the drift that its mismatch tell of, 0 to
            1: data are collected at 0.
        twin: an arm file, such as `s2c2a identify` writes: it moves as that one, while
            `arm` is what one is told of it.
        happens: what comes about while it works (`events.SAMPLE`).

    Raises:
        S2C2AError: unknown fidelity, impossible payload, seed, jitter, age or
            happening, or a twin of another form.
    """

    own_time = True

    def __init__(
        self,
        arm: ArmSpec,
        fidelity: str = "fast",
        seed: int = 0,
        payload: float = 0.0,
        jitter: float = 0.0,
        watched: bool = False,
        aged: float = 0.0,
        twin: str = "",
        happens: str = "",
    ):
        if seed < 0 or not (0 <= jitter <= 1 and 0 <= aged <= 1):
            raise S2C2AError(
                f"seed {seed}, jitter {jitter}, aged {aged} asked for; no seed is negative, the others are from 0 to 1"
            )
        self.arm = arm
        self._geometry = ArmGeometry.of(arm)
        self._fidelity = fidelity_named(fidelity)
        self._body = twin_of(arm, twin) if twin else arm
        self._seed = seed
        self._jitter = jitter
        self._watched = watched
        self._aged = aged
        self._openings = 0
        self._payload = payload
        self._hung = payload
        self._firm = 1.0
        self._every = parse_events(happens)
        if any(one.kind == "blind" for one in self._every) and (
            arm.sensing == "true" or arm.sensors.bends
        ):
            raise S2C2AError(
                "an arm that sees its bends cannot go blind: the simulation scores runs by them"
            )
        self.model = self._model_with(payload)
        self.data = mujoco.MjData(self.model)
        self._rollout = Rollout(nthread=0)
        modules = range(arm.module_count)
        self._base_sites = [self.model.site(f"base_{module}").id for module in modules]
        self._end_sites = [self.model.site(f"end_{module}").id for module in modules]
        self._tip_body = self.model.site_bodyid[self._end_sites[-1]]
        self._sensing = bool(self.model.nsensordata)
        self._points = 3 * CENTER_LINE_POINTS * arm.module_count if watched else 0
        self._relaxing = per_module(self._body, "mismatch.relaxing").any()
        self._relaxation = Relaxation(self._body, self.model)
        self._rest()

    def _rest(self) -> None:
        self._random = np.random.default_rng(self._seed)
        self._motors = self._command = self._geometry.action_neutral.copy()
        self._seen: np.ndarray | None = None
        self._beside = Beside(self._body, self._seed, self._openings)
        self._homed_at = self._homing_errors()
        self._happenings = EventSchedule(())
        self._blind = False
        inward = -1.0 if self.arm.actuation == "displacement" else 1.0
        self._currents = Currents(self._body.motor, self._motors, inward)
        self._transmission = CableTransmission(
            self._body, self._motors + self._homed_at, self._aged
        )
        self._relaxation.used_to[:] = 0.0
        self.model.qpos_spring = self._relaxation.springs
        self._step = 0
        self._push = np.zeros(3)
        self._last_states: States | None = None
        mujoco.mj_forward(self.model, self.data)

    @property
    def sensors(self) -> dict[str, Sensor]:
        """What readings hold."""
        moments = (
            len(self._physics_times(self.arm.control_period)) + 1
            if self._watched
            else 0
        )
        return declared_sensors(self.arm, self._geometry, moments) | sensed_beside(
            self._body
        )

    def open(self) -> Reading:
        """Go to rest, settle for one second, and start the clock at zero."""
        if self._every or self._firm < 1.0:
            self._firm = 1.0
            self.load(self._payload)
        mujoco.mj_resetData(self.model, self.data)
        self._openings += 1
        self._rest()
        self.step(self._jittered())
        for _ in range(max(1, int(np.ceil(SETTLING_TIME * self.arm.control_rate)))):
            self.step(self._geometry.action_neutral)
        self._happenings = EventSchedule(self._every)
        self._step = 0
        self.data.time = 0.0
        self._beside.begin(self.states())
        return self.read()

    def read(self) -> Reading:
        """What the sensors say now, and the truth beside it.

        Raises:
            SimulationError: the simulated arm blew up before; open it again.
        """
        self._check_sane()
        said = {
            "cables": self._measured_cables(),
            "states": self.states(),
            "configurations": self.configurations(),
        }
        if self.arm.motor.current_noise is not None:
            said["tensions"] = self._currents.read(
                self._tensions_at_motors(), self.arm.motor.current_noise, self._random
            )
        if self._seen is not None:
            said["center_line"] = self._seen
        said |= self._beside.read(self.data.time)
        if self._blind:
            said = {
                name: said[name]
                for name in said.keys() - {"tensions", *sensed_beside(self._body)}
            }
        return Reading(self.data.time, said)

    def send(self, action: Actions) -> Actions:
        """Ask for an action from now on; see `Robot.send`.

        Raises:
            ActionError: wrong shape or not finite; nothing has moved.
        """
        self._command = checked_action(action, self._geometry)
        return self._command.copy()

    def advance(self, seconds: float) -> None:
        """Let simulated time pass, in whole physics steps.

        Raises:
            SimulationError: the simulated arm blew up.
        """
        self._check_sane()
        self._happenings.until(self.data.time, self)
        times = self._physics_times(seconds)
        path = motor_path(self._motors, self._command, times, self._body.motor)
        felt = self._transmission.pass_on(
            path + self._homed_at, times, self.tensions(), self._bend_angles()
        )
        self._motors = path[-1]
        self._currents.move(self._motors)
        turns = self.data.qpos.copy()
        commands = felt.reshape(len(felt), -1)
        wrenches = self._wrenches() if self._push.any() else None
        seen = stepped(self._rollout, self.model, self.data, commands, wrenches)
        if self._relaxing:
            self._relaxation.advance((turns + self.data.qpos) / 2, times[-1])
            self.model.qpos_spring = self._relaxation.springs
        mujoco.mj_forward(self.model, self.data)
        if self._sensing:  # in a physics step, sensors say what was at its start
            moments = np.vstack([seen, self.data.sensordata])
            self._seen = (
                moments[:, : self._points].reshape(len(moments), -1, 3)
                if self._watched
                else None
            )
            self._beside.feel(moments[1:, self._points :])
        self._step += 1
        self._check_sane()
        self._last_states = self.states()
        self._beside.look(self.data.time, seconds, self._last_states)

    def step(self, action: Actions) -> Actions:
        """Send an action and let one control period pass; returns what was really sent."""
        sent = self.send(action)
        self.advance(self.arm.control_period)
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
        model = self._model_with(payload)
        self._hung = payload
        self.data = taken_over(self.model, self.data, model)
        self.model = model

    def homed(self, slipped: float) -> None:
        """Let the zeros of all motors slip, each by so much [m] one way or the other."""
        ways = np.random.default_rng([self._seed, 6, self._openings]).choice(
            [-1.0, 1.0], self._motors.shape
        )
        self._homed_at = self._homed_at + slipped * ways

    def softer(self, share: float) -> None:
        """Let the first cable of the first module, which carries most, lose a share of its stiffness."""
        self._firm *= 1.0 - share
        self.load(self._hung)

    def blind(self) -> None:
        """From now on nothing is said of the arm beside what its motors say."""
        self._blind = True

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

    def _model_with(self, payload: float) -> mujoco.MjModel:
        if not (np.isfinite(payload) and 0 <= payload <= MAX_PAYLOAD):
            raise S2C2AError(
                f"payload {payload} kg is not between 0 and {MAX_PAYLOAD:g} kg"
            )
        model = build_model(self._body, self._fidelity, payload, self._watched)
        model.actuator_gainprm[0, 0] *= self._firm
        model.actuator_biasprm[0, :2] *= self._firm
        return model

    def _jittered(self) -> Actions:
        """An action a little off neutral, in a random direction of every module."""
        angles = np.random.default_rng([self._seed, 1]).uniform(
            0, 2 * np.pi, self.arm.module_count
        )
        shares = self._jitter * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        return self._geometry.actions_at(shares)

    def _physics_times(self, seconds: float) -> Float[np.ndarray, " times"]:
        """Ends of the physics steps of so much time [s], from its start."""
        step = self.model.opt.timestep
        return step * np.arange(1, max(1, round(seconds / step)) + 1)

    def _wrenches(self) -> Float[np.ndarray, "bodies 6"]:
        """The push, and its torque: MuJoCo applies forces at centers of mass, this one is at the tip."""
        wrenches = np.zeros_like(self.data.xfrc_applied)
        lever = (
            self.data.site_xpos[self._end_sites[-1]] - self.data.xipos[self._tip_body]
        )
        wrenches[self._tip_body] = [*self._push, *np.cross(lever, self._push)]
        return wrenches

    def _axes(self, sites: list[int]) -> Float[np.ndarray, "modules 3"]:
        return self.data.site_xmat[sites].reshape(-1, 3, 3)[:, :, 2]

    def _bend_angles(self) -> Float[np.ndarray, " modules"]:
        configurations = self.configurations()
        return np.arctan2(
            np.linalg.norm(configurations[:, :2], axis=-1), configurations[:, 2]
        )

    def _measured_cables(self) -> Actions:
        if self.arm.actuation == "displacement":
            return encoder_reading(self._motors, self.arm.motor, self._random)
        return self._motors + self._random.normal(
            scale=self.arm.motor.noise_tension, size=self._motors.shape
        )

    def _homing_errors(self) -> Actions:
        """How far the motors' zero is from where their encoders say it is [m], anew at every opening."""
        random = np.random.default_rng([self._seed, 2, self._openings])
        return random.normal(
            scale=self._body.motor.homing_error, size=self._motors.shape
        )

    def _tensions_at_motors(self) -> Actions:
        """With the friction in tubes [N]."""
        if self.arm.actuation == "tension":
            return self._motors
        drag = per_cable(
            self._body, "cable.viscous_friction"
        ) * self.data.ten_velocity.reshape(self._motors.shape)
        taut = np.maximum(self.tensions() - drag, 0.0)
        return self._transmission.at_motors(
            taut, self._bend_angles(), self._currents.winding
        )

    def _check_sane(self) -> None:
        # after any of them a rollout goes no further
        bad = self.data.warning.number.any()
        if bad or not (
            np.isfinite(self.data.qpos).all() and np.isfinite(self.data.qvel).all()
        ):
            raise SimulationError(
                f"{self.arm.name}: the simulation blew up in control step {self._step}, at {self.data.time:.2f} s; "
                "give the modules more mass or damping, or softer cables; then open it again",
                self._step,
                self._last_states,
            )
