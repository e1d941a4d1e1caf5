"""Arm and motors behind emulated servos, advanced to the wall clock."""

from dataclasses import dataclass

from s2c2a.robots.simulation import SimulatedRobot  # isort: skip  # safe start of MuJoCo
import mujoco
import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.arm.geometry import cables_present
from s2c2a.arm.sensors import Sensors
from s2c2a.errors import S2C2AError

Cables = Float[np.ndarray, " cables"]

SLACK = (0.001, 0.006)  # m; of cables at power-up
LONGEST_CHUNK = 0.01  # s; of physics between two looks at the line
_SLACK_RANGE = 2.0  # m; the largest travel of a cable that an arm file may state
_SNAPPED = 1.0  # m; paid out, so that the arm does not feel the cable
_SETTLING_TIME = 1.0  # s
_HOLDING_FRICTION = 2.0  # N; of a gear without power
DRIVING_FRICTION = 0.4  # N; of a gear that the motor drives
_BACK_DRIVING = 0.004  # m/s per N beyond that friction
_JAM = 0.0005  # m; goal error at which a stalled motor pulls with all its force

_SLACK_STREAM = 11


@dataclass
class Targets:
    """What the motors follow, in the units of cables; arrays of shape (cables,).

    Attributes:
        torque: whether a motor is powered.
        goal: displacement [m].
        speed: largest speed [m/s].
        tension: largest tension [N].
    """

    torque: np.ndarray
    goal: np.ndarray
    speed: np.ndarray
    tension: np.ndarray


@dataclass(frozen=True)
class FramePose:
    """Position [m] and unit quaternion (scalar last) of a frame, base frame."""

    position: np.ndarray
    rotation: np.ndarray


def approach(
    position: Cables, goal: Cables, seconds: float, lag: float, speed: Cables
) -> Cables:
    """Return where motors are after a time, towards constant goals.

    A motor moves at its largest speed until its first-order lag is slower, as the
    motors of the simulated robot do.

    Args:
        position: now [m].
        goal: [m].
        seconds: the time.
        lag: time constant [s].
        speed: largest speeds [m/s].
    """
    distance = np.abs(goal - position)
    lag_distance = np.minimum(distance, speed * lag)
    speed = np.maximum(speed, 1e-9)
    limited_time = (distance - lag_distance) / speed
    lag_time = np.maximum(seconds - limited_time, 0.0)
    lagging = lag_distance * np.exp(-lag_time / lag) if lag else 0.0
    limited = distance - speed * seconds
    remaining = np.where(seconds < limited_time, limited, lagging)
    return goal - np.sign(goal - position) * remaining


class Plant:
    """Physics of an arm whose cables are wound by motors.

    Arrays have one entry a cable, module by module. Displacements are positive where
    a cable is paid out.

    Args:
        arm: description of the arm.
        fidelity: of the simulation.
        seed: of the slack at power-up.
        payload: mass at the tip [kg].
        homed: whether the cables start without slack.

    Attributes:
        time: simulated time [s].
        chunk: simulated time of one `advance` [s].
        positions: of the motors [m].
        velocities: of the motors [m/s].
        tensions: at the motors [N].
        targets: what the motors follow.
        snapped: cables that are torn.
        stalled: motors that are jammed.

    Raises:
        S2C2AError: the arm has tension actuation.
    """

    def __init__(
        self,
        arm: ArmSpec,
        fidelity: str = "fast",
        seed: int = 0,
        payload: float = 0.0,
        homed: bool = False,
    ):
        if arm.actuation != "displacement":
            raise S2C2AError(
                f"{arm.name} has {arm.actuation} actuation, and servos wind cables by "
                'displacement; choose an arm with actuation = "displacement"'
            )
        self.arm = arm
        self._robot = SimulatedRobot(_with_ideal_motors(arm), fidelity, seed, payload)
        self._robot.open()
        self._present = cables_present(arm)
        count = int(self._present.sum())
        self._limit = np.inf if arm.motor.speed_limit is None else arm.motor.speed_limit
        self.snapped = np.zeros(count, bool)
        self.stalled = np.zeros(count, bool)
        self.targets = Targets(
            np.zeros(count, bool), np.zeros(count), np.zeros(count), np.zeros(count)
        )
        random = np.random.default_rng([seed, _SLACK_STREAM])
        slack = random.uniform(*SLACK, count)
        self.positions = np.zeros(count) if homed else slack
        self.velocities = np.zeros(count)
        self.tensions = np.zeros(count)
        step = self._robot.model.opt.timestep
        self.chunk = step * max(1, int(LONGEST_CHUNK / step + 1e-9))
        for _ in range(round(_SETTLING_TIME / self.chunk)):
            self._advance_physics()
        self.time = 0.0

    @property
    def stiffnesses(self) -> Cables:
        """Stiffness of the cables [N/m]."""
        return self._robot.model.actuator_gainprm[:, 0]

    @property
    def lead(self) -> float:
        """Mean time by which the arm follows the motors before they read so [s].

        All physics steps of a chunk get the positions at its end, and a step of length
        h yields q(t + h) from q(t) and the position that holds until t + h: the first
        step leads by the chunk, the last one by h.
        """
        return (self.chunk + self._robot.model.opt.timestep) / 2

    def advance(self) -> None:
        """Move the motors and simulate one chunk.

        Raises:
            SimulationError: the simulation diverged.
        """
        before = self.positions
        # positions of the motors after a chunk
        pulls = self.pulls()
        moved = np.where(
            self.targets.torque, self._drive(pulls), self._back_drive(pulls)
        )
        self.positions = np.where(self.stalled, self.positions, moved)
        self.velocities = (self.positions - before) / self.chunk
        self._advance_physics()
        self.time += self.chunk

    def states(self) -> Float[np.ndarray, "modules 6"]:
        """Return the true states, base frame."""
        return self._robot.states()

    def poses(self) -> dict[str, FramePose]:
        """Return the true frames of the base and of the module ends, by name."""
        poses = {"base": FramePose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))}
        for module in range(self.arm.module_count):
            site = self._robot.data.site(f"end_{module}")
            quaternion = np.empty(4)
            mujoco.mju_mat2Quat(quaternion, site.xmat)
            poses[f"end-{module + 1}"] = FramePose(
                site.xpos.copy(), np.roll(quaternion, -1)
            )
        return poses

    def pulls(self) -> Cables:
        """Return the force of the cables as springs [N]: negative in slack cables."""
        model = self._robot.model
        data = self._robot.data
        force = model.actuator_gainprm[:, 0] * data.ctrl
        force = force + model.actuator_biasprm[:, 0]
        force = force + model.actuator_biasprm[:, 1] * data.actuator_length
        return np.where(self.snapped, -np.inf, -force)

    def _drive(self, pulls: Cables) -> Cables:
        """Move powered motors; winding stops at the tension limit, and yields above it.

        The friction of the gears works against both.
        """
        targets = self.targets
        speed = np.minimum(targets.speed, self._limit)
        lag = self.arm.motor.time_constant
        largest_step = speed * self.chunk
        wanted = approach(self.positions, targets.goal, self.chunk, lag, speed)
        winding = targets.tension - DRIVING_FRICTION - pulls
        yielding = pulls - targets.tension - DRIVING_FRICTION
        innermost = self.positions - np.maximum(winding, 0.0) / self.stiffnesses
        outward = np.maximum(yielding, 0.0) / self.stiffnesses
        pulled_out = self.positions + np.minimum(outward, largest_step)
        wanted = np.maximum(wanted, innermost)
        return np.where(yielding > 0, np.maximum(wanted, pulled_out), wanted)

    def _back_drive(self, pulls: Cables) -> Cables:
        """Let cables turn motors without power, against the friction of the gears."""
        excess = np.maximum(pulls - _HOLDING_FRICTION, 0.0)
        step = np.minimum(_BACK_DRIVING * self.chunk, 1 / self.stiffnesses)
        return self.positions + step * excess

    def _advance_physics(self) -> None:
        action = np.where(self.snapped, _SNAPPED, self.positions)
        rows = np.zeros(self._present.shape)
        rows[self._present] = action
        self._robot.step(rows, self.chunk)
        tensions = self._robot.read()["tensions"][self._present]
        self.tensions = np.where(self.snapped, 0.0, tensions)
        errors = np.abs(self.targets.goal - self.positions)
        jammed = self.stalled & self.targets.torque & (errors > _JAM)
        self.tensions = np.where(jammed, self.targets.tension, self.tensions)


def _with_ideal_motors(arm: ArmSpec) -> ArmSpec:
    """Return the arm with motors that follow at once, and cables of any length.

    The lag and the speed limit are those of the servos in front of it.
    """
    motor = arm.motor.model_copy(
        update={
            "time_constant": 0.0,
            "speed_limit": None,
            "homing_error": 0.0,
            "current_noise": 0.0,
        }
    )
    modules = tuple(
        module.model_copy(
            update={"cable": module.cable.model_copy(update={"travel": _SLACK_RANGE})}
        )
        for module in arm.modules
    )
    update = {"motor": motor, "modules": modules, "sensors": Sensors()}
    return arm.model_copy(update=update)
