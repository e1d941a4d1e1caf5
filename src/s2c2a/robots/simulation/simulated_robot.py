"""A cable-driven soft arm simulated in MuJoCo."""

from collections.abc import Sequence

import mujoco
import numpy as np
from jaxtyping import Float
from mujoco.rollout import Rollout

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.arm.geometry import cables_present, directions_at, per_cable, per_module
from s2c2a.arm.spec import MAX_PAYLOAD, warn_of_payload
from s2c2a.errors import S2C2AError, SimulationError
from s2c2a.robots.robot import SETTLING_TIME, Robot, checked_action
from s2c2a.robots.simulation.chain import build_model, get_fidelity
from s2c2a.robots.simulation.declared_sensors import declare_sensors
from s2c2a.robots.simulation.events import EventSchedule, parse_events
from s2c2a.robots.simulation.extra_sensors import (
    ExtraSensors,
    MotorCurrents,
    declare_extra_sensors,
)
from s2c2a.robots.simulation.random_streams import Stream, random_stream
from s2c2a.robots.simulation.relaxation import JointPositions, Relaxation
from s2c2a.robots.simulation.sensor_faults import SensorFaults
from s2c2a.robots.simulation.stepping import run_physics_steps, transfer_state
from s2c2a.robots.simulation.transmission import (
    CableTransmission,
    compute_motor_path,
    measurement_noise,
    read_cables,
)
from s2c2a.robots.simulation.twin import load_twin
from s2c2a.spaces import CENTER_LINE_POINTS, Actions, Reading, Sensor, States

GROUND_TRUTH = {"states", "center_line"}


class SimulatedRobot(Robot):
    """A robot in MuJoCo with a clock of its own, which runs in `advance` only.

    Args:
        arm: description of the arm that controllers know.
        fidelity: "fast" or "accurate".
        seed: seed of sensor noise and homing errors; the physics is deterministic.
        payload: mass at the tip [kg].
        jitter: initial displacement of every module in a random direction, as a share
            of the full bend (0 to 1). The arm then settles at rest with another state
            of its hysteresis.
        center_line: whether readings contain the center line at every physics step, at a
            small cost in time.
        aged: share of the drift in the arm's model mismatch that has developed (0 to
            1). Data are collected at 0.
        twin: arm file of the simulated mechanics, such as `s2c2a identify` writes.
            Controllers still know `arm` only. Empty: the simulation uses `arm`.
        events: events during the run, as text (`events.EXAMPLE`) or several texts.

    Raises:
        S2C2AError: the fidelity is unknown, the payload, seed, jitter, age or an event
            is invalid, or the twin has another number of modules, cables or another
            actuation.

    Attributes:
        model: MuJoCo's model of the arm.
        data: its state.
        end_sites: MuJoCo's numbers of the modules' ends.
        motors: positions of the motors [m or N], shape (modules, cables).
        homing_errors: offsets of their zeros [m], likewise.
        transmission: losses between motors and modules.
    """

    own_time = True

    def __init__(
        self,
        arm: ArmSpec,
        fidelity: str = "fast",
        seed: int = 0,
        payload: float = 0.0,
        jitter: float = 0.0,
        center_line: bool = False,
        aged: float = 0.0,
        twin: str = "",
        events: str | Sequence[str] = "",
    ):
        if seed < 0 or not (0 <= jitter <= 1 and 0 <= aged <= 1):
            raise S2C2AError(
                f"seed {seed}, jitter {jitter}, aged {aged} are not allowed; "
                "give a seed of 0 or more, and jitter and aged from 0 to 1"
            )
        self.arm = arm
        self._geometry = ArmGeometry.of(arm)
        self._present = cables_present(arm)
        self._fidelity = get_fidelity(fidelity)
        self._true_arm = load_twin(arm, twin) if twin else arm
        self._seed = seed
        self._jitter = jitter
        self._has_center_line = center_line
        self._aged = aged
        self._open_count = 0
        self._initial_payload = payload
        self._payload = payload
        self._remaining_stiffness = 1.0
        self._events = parse_events(events)
        true_bends = arm.sensing == "true" or arm.sensors.bends
        if true_bends and any(event.kind == "sensor_loss" for event in self._events):
            raise S2C2AError(
                "the event sensor_loss is not allowed for an arm with true bends "
                '(sensing = "true" or sensors.bends): they are also the simulation\'s '
                "ground truth; remove the event or choose another sensing"
            )
        self.model = self._build_model(payload)
        self.data = mujoco.MjData(self.model)
        self._rollout = Rollout(nthread=0)
        modules = range(arm.module_count)
        self._base_sites = [self.model.site(f"base_{module}").id for module in modules]
        self.end_sites = [self.model.site(f"end_{module}").id for module in modules]
        self._tip_body = self.model.site_bodyid[self.end_sites[-1]]
        points = CENTER_LINE_POINTS * arm.module_count if center_line else 0
        self._center_line_size = 3 * points
        self._relaxes = per_module(self._true_arm, "mismatch.relaxing").any()
        self._relaxation = Relaxation(self._true_arm, self.model)
        self._reset()
        allowed = sorted(self.sensors.keys() - GROUND_TRUTH)
        for event in self._events:
            if event.is_sensor_fault and event.sensor not in allowed:
                raise S2C2AError(
                    f"the arm has no sensor '{event.sensor}' that can have the fault "
                    f"{event.kind}; it has {', '.join(allowed)}"
                )

    def _reset(self) -> None:
        arm = self._true_arm
        self._random = np.random.default_rng(self._seed)
        self._command = self._geometry.action_neutral.copy()
        self.motors = self._command
        self._center_line: np.ndarray | None = None
        self._extra_sensors = ExtraSensors(arm, self._seed, self._open_count)
        homing = random_stream(self._seed, Stream.HOMING, self._open_count)
        self.homing_errors = self._present * homing.normal(
            scale=arm.motor.homing_error, size=self.motors.shape
        )
        self._schedule = EventSchedule(())
        self._sensors_lost = False
        self._sensor_faults = SensorFaults(self._seed)
        inward = -1.0 if self.arm.actuation == "displacement" else 1.0
        self._currents = MotorCurrents(arm.motor, self.motors, inward)
        self.transmission = CableTransmission(
            arm, self.motors + self.homing_errors, self._aged
        )
        self._relaxation.relaxed[:] = 0.0
        self.model.qpos_spring = self._relaxation.spring_references
        self._step = 0
        self._force = np.zeros(3)
        self._last_states: States | None = None
        mujoco.mj_forward(self.model, self.data)

    @property
    def sensors(self) -> dict[str, Sensor]:
        samples = 0
        if self._has_center_line:
            samples = len(self.physics_times(self.arm.control_period)) + 1
        sensors = declare_sensors(self.arm, self._geometry, samples)
        return sensors | declare_extra_sensors(self._true_arm)

    def open(self) -> Reading:
        """Go to rest, settle for one second and start the clock at zero."""
        if self._events or self._remaining_stiffness < 1.0:
            self._remaining_stiffness = 1.0
            self.set_payload(self._initial_payload)
        mujoco.mj_resetData(self.model, self.data)
        self._open_count += 1
        self._reset()
        # an action near neutral, in a random direction for every module
        random = random_stream(self._seed, Stream.JITTER)
        angles = random.uniform(0, 2 * np.pi, self.arm.module_count)
        shares = self._jitter * directions_at(angles)
        self.step(self._geometry.actions_at(shares))
        for _ in range(max(1, int(np.ceil(SETTLING_TIME * self.arm.control_rate)))):
            self.step(self._geometry.action_neutral)
        self._schedule = EventSchedule(self._events)
        self._step = 0
        self.data.time = 0.0
        self._extra_sensors.start(self.states())
        return self.read()

    def read(self) -> Reading:
        """Return the current measurements and the ground truth.

        Raises:
            SimulationError: the simulation diverged earlier; open the robot again.
        """
        self._check_finite()
        values = {
            "cables": self.measure_cables(),
            "states": self.states(),
            "configurations": self.configurations(),
        }
        noise = self.arm.motor.current_noise
        if noise is not None:
            values["tensions"] = self._present * self._currents.read(
                self._motor_tensions(), noise, self._random
            )
        if self._center_line is not None:
            values["center_line"] = self._center_line
        values |= self._extra_sensors.read(self.data.time)
        if self._sensors_lost:
            for name in ("tensions", *declare_extra_sensors(self._true_arm)):
                values.pop(name, None)
        values = self._sensor_faults.apply(values, self.data.time)
        return Reading(self.data.time, values)

    def send(self, action: Actions) -> Actions:
        """Set the commanded action; see `Robot.send`.

        Raises:
            ActionError: the shape is wrong or a number is not finite; nothing moves.
        """
        self._command = checked_action(action, self._geometry)
        return self._command.copy()

    def advance(self, seconds: float) -> None:
        """Simulate the given time in whole physics steps.

        Raises:
            SimulationError: the simulation diverged.
        """
        self._check_finite()
        self._schedule.apply_until(self.data.time, self)
        times = self.physics_times(seconds)
        path = compute_motor_path(
            self.motors, self._command, times, self._true_arm.motor
        )
        transmitted = self.transmission.transmit(
            path + self.homing_errors, times, self.tensions(), self.bend_angles()
        )
        self.motors = path[-1]
        self._currents.move(self.motors)
        commands = transmitted[:, self._present]
        positions = self.data.qpos.copy()
        wrenches = self.tip_wrenches() if self._force.any() else None
        measurements = run_physics_steps(
            self._rollout, self.model, self.data, commands, wrenches
        )
        self.relax(positions, times[-1])
        mujoco.mj_forward(self.model, self.data)
        if self.model.nsensordata:
            # MuJoCo evaluates sensors at the start of a physics step.
            samples = np.vstack([measurements, self.data.sensordata])
            if self._has_center_line:
                points = samples[:, : self._center_line_size]
                self._center_line = points.reshape(len(samples), -1, 3)
            self._extra_sensors.sample_inertial(samples[1:, self._center_line_size :])
        self._step += 1
        self._check_finite()
        self._last_states = self.states()
        self._extra_sensors.observe(self.data.time, seconds, self._last_states)

    def relax(self, positions: JointPositions, seconds: float) -> None:
        """Relax the modules after a motion of some time from joint positions [rad]."""
        if self._relaxes:
            self._relaxation.advance((positions + self.data.qpos) / 2, seconds)
            self.model.qpos_spring = self._relaxation.spring_references

    def step(self, action: Actions, seconds: float | None = None) -> Actions:
        """Send an action and advance the simulation; returns the action sent.

        Args:
            action: see `send`.
            seconds: time to simulate [s]; one control period by default.
        """
        sent = self.send(action)
        self.advance(self.arm.control_period if seconds is None else seconds)
        return sent

    def close(self) -> None:
        """Do nothing: the simulation holds no resource."""

    def apply_force(self, force: Float[np.ndarray, "3"]) -> None:
        """Apply an external force [N] at the tip, base frame, until the next call.

        Opening the robot removes the force.

        Raises:
            S2C2AError: the force is not three finite numbers.
        """
        values = np.asarray(force, dtype=float)
        if values.shape != (3,) or not np.isfinite(values).all():
            raise S2C2AError(f"a force is three finite numbers [N], got {force}")
        self._force = values

    def set_payload(self, payload: float) -> None:
        """Replace the mass at the tip [kg]; configuration and velocity stay.

        Raises:
            S2C2AError: the payload is negative, too large or not finite.
        """
        model = self._build_model(payload)
        self._payload = payload
        self.data = transfer_state(self.model, self.data, model)
        self.model = model

    def add_homing_error(self, size: float) -> None:
        """Shift the zero of every motor by `size` [m] in a random direction."""
        random = random_stream(self._seed, Stream.HOMING_EVENT, self._open_count)
        signs = random.choice([-1.0, 1.0], self.motors.shape)
        self.homing_errors = self.homing_errors + size * self._present * signs

    def reduce_cable_stiffness(self, share: float) -> None:
        """Reduce the stiffness of cable 0 of module 0, the most loaded, by a share."""
        self._remaining_stiffness *= 1.0 - share
        self.set_payload(self._payload)

    def lose_sensors(self) -> None:
        """Remove all sensors but encoders and ground truth from later readings."""
        self._sensors_lost = True

    def set_sensor_fault(self, sensor: str, kind: str, amount: float = 0.0) -> None:
        """Change the readings of a sensor from now on (`sensor_faults.KINDS`)."""
        self._sensor_faults.set(sensor, kind, amount, self.data.time)

    def states(self) -> States:
        """Return the true states, shape (modules, 6), base frame."""
        positions = self.data.site_xpos[self.end_sites]
        return np.concatenate([positions, self._site_axes(self.end_sites)], axis=-1)

    def configurations(self) -> Float[np.ndarray, "modules 3"]:
        """Return the true configurations: end axes in module frames, (modules, 3)."""
        bases = self.data.site_xmat[self._base_sites].reshape(-1, 3, 3)
        return np.einsum("mij,mi->mj", bases, self._site_axes(self.end_sites))

    def tensions(self) -> Float[np.ndarray, "modules cables"]:
        """Return the tensions at the modules [N], shape (modules, cables)."""
        return self._per_cable(-self.data.actuator_force)

    def _per_cable(
        self, values: Float[np.ndarray, " cables"]
    ) -> Float[np.ndarray, "modules cables"]:
        """Values of MuJoCo's cables by module; zero where a module has no cable."""
        rows = np.zeros(self._present.shape)
        rows[self._present] = values
        return rows

    def _build_model(self, payload: float) -> mujoco.MjModel:
        if not (np.isfinite(payload) and 0 <= payload <= MAX_PAYLOAD):
            raise S2C2AError(
                f"payload {payload} kg is not between 0 and {MAX_PAYLOAD:g} kg"
            )
        warn_of_payload(payload, self.arm)
        model = build_model(
            self._true_arm, self._fidelity, payload, self._has_center_line
        )
        model.actuator_gainprm[0, 0] *= self._remaining_stiffness
        model.actuator_biasprm[0, :2] *= self._remaining_stiffness
        return model

    def physics_times(self, seconds: float) -> Float[np.ndarray, " times"]:
        """Return the end times [s] of the physics steps within a duration."""
        step = self.model.opt.timestep
        return step * np.arange(1, max(1, round(seconds / step)) + 1)

    def tip_wrenches(self) -> Float[np.ndarray, "bodies 6"]:
        """Return the external force at the tip as wrenches at centers of mass."""
        wrenches = np.zeros_like(self.data.xfrc_applied)
        tip = self.data.site_xpos[self.end_sites[-1]]
        lever = tip - self.data.xipos[self._tip_body]
        wrenches[self._tip_body, :3] = self._force
        wrenches[self._tip_body, 3:] = np.cross(lever, self._force)
        return wrenches

    def _site_axes(self, sites: list[int]) -> Float[np.ndarray, "modules 3"]:
        return self.data.site_xmat[sites].reshape(-1, 3, 3)[:, :, 2]

    def bend_angles(self) -> Float[np.ndarray, " modules"]:
        """Return the angles of the true bends [rad], shape (modules,)."""
        configurations = self.configurations()
        lateral = np.linalg.norm(configurations[:, :2], axis=-1)
        return np.arctan2(lateral, configurations[:, 2])

    def measure_cables(self) -> Actions:
        """Return a measurement of the cables [m or N], as in `read`, without faults."""
        return read_cables(self.arm, self.motors, self.sample_noise())

    def sample_noise(self) -> Actions:
        """Sample the noise of the next measurement of the cables."""
        return self._random.normal(
            scale=measurement_noise(self.arm), size=self.motors.shape
        )

    def _motor_tensions(self) -> Actions:
        """Return the tensions at the motors [N], with the friction of the tubes."""
        if self.arm.actuation == "tension":
            return self.motors
        friction = per_cable(self._true_arm, "cable.viscous_friction")
        drag = friction * self._per_cable(self.data.ten_velocity)
        spring_tensions = np.maximum(self.tensions() - drag, 0.0)
        return self.transmission.motor_tensions(
            spring_tensions, self.bend_angles(), self._currents.winding
        )

    def _check_finite(self) -> None:
        # A rollout stops at the first of these warnings.
        warned = self.data.warning.number.any()
        # a sum is finite only if all are; this runs several times a step
        finite = np.isfinite(self.data.qpos.sum() + self.data.qvel.sum())
        if warned or not finite:
            raise SimulationError(
                f"{self.arm.name}: the simulation diverged in control step "
                f"{self._step}, at {self.data.time:.2f} s; give the modules more mass "
                "or damping, or softer cables, and open the robot again",
                self._step,
                self._last_states,
            )
