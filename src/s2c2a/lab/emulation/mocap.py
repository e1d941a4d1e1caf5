"""Event loop of emulated motion capture of a simulated arm, in real time."""

import select
import time
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.errors import S2C2AError
from s2c2a.lab.emulation.mocap_server import MocapServer, StreamOptions
from s2c2a.lab.emulation.motive import Motive, MotiveOptions
from s2c2a.lab.emulation.plant import Plant, Pose
from s2c2a.lab.emulation.pose_datagrams import DatagramOptions, PoseDatagrams
from s2c2a.lab.emulation.qtm import Qtm, QtmOptions

OPTIONS: Mapping[str, type[StreamOptions]] = {
    "natnet": MotiveOptions,
    "qualisys": QtmOptions,
    "udp": DatagramOptions,
}
"""Options by protocol."""
MOTIONS = ("none", "babble")
_LATEST = 0.2  # s; physics that is later than this loses the time
_LONGEST_SLEEP = 0.1  # s
_SPEED = 0.1  # m/s
_TENSION = 100.0  # N
_FREQUENCIES = (0.03, 0.2)  # Hz
_SINES = 3
_LARGEST_BEND = 0.5  # share of the full bend
_RAMP = 2.0  # s; the motion begins slowly
_MOTION_STREAM = 16


class Babbling:
    """A slow random motion of all modules: sines of bends, from a seed."""

    def __init__(self, arm: ArmSpec, seed: int):
        """Draw frequencies and phases.

        Args:
            arm: that moves.
            seed: of the motion.
        """
        random = np.random.default_rng([seed, _MOTION_STREAM])
        self._geometry = ArmGeometry.of(arm)
        shape = (arm.module_count, 2, _SINES)
        self._frequencies = random.uniform(*_FREQUENCIES, shape)
        self._phases = random.uniform(0, 2 * np.pi, shape)

    def goals(self, now: float) -> Float[np.ndarray, " cables"]:
        """Return the displacements of the cables [m] at a time [s]."""
        geometry = self._geometry
        sines = np.sin(2 * np.pi * self._frequencies * now + self._phases)
        ramp = min(now / _RAMP, 1.0)
        bends = _LARGEST_BEND / np.sqrt(2) * ramp * sines.mean(axis=-1)
        actions = geometry.actions_at(bends)
        return np.clip(actions, geometry.action_low, geometry.action_high).ravel()


def make_server(names: Sequence[str], options: StreamOptions) -> MocapServer:
    """Return the server of the protocol that the options are of.

    Args:
        names: of the rigid bodies.
        options: of Motive, of QTM or of JSON datagrams.

    Raises:
        S2C2AError: a fault is invalid.
    """
    match options:
        case MotiveOptions():
            return Motive(names, options)
        case QtmOptions():
            return Qtm(names, options)
        case DatagramOptions():
            return PoseDatagrams(names, options)
    raise S2C2AError(f"no protocol has {type(options).__name__}")


class MocapEmulator:
    """An arm, its motion, and motion capture that tracks base and module ends.

    Attributes:
        plant: the arm and its motors.
        server: of the poses.
        late: time that the physics lost on a busy machine [s].
    """

    def __init__(
        self,
        arm: ArmSpec,
        options: StreamOptions,
        motion: str = "none",
        fidelity: str = "fast",
        payload: float = 0.0,
        duration: float = float("inf"),
    ):
        """Power the motors up; `run` opens the ports.

        Args:
            arm: that is tracked.
            options: of Motive, of QTM or of JSON datagrams.
            motion: "none", or "babble" for a slow random motion.
            fidelity: of the simulation.
            payload: mass at the tip [kg].
            duration: time after which the emulator ends [s].

        Raises:
            S2C2AError: the arm has tension actuation, or an option is invalid.
        """
        if motion not in MOTIONS:
            raise S2C2AError(f"motion '{motion}'; give {' or '.join(MOTIONS)}")
        if not duration > 0:
            raise S2C2AError(f"duration {duration} s is not allowed; give more than 0")
        self.plant = Plant(arm, fidelity, options.seed, payload, homed=True)
        self.server = make_server(list(self.plant.poses()), options)
        self._babbling = Babbling(arm, options.seed) if motion == "babble" else None
        self._duration = duration
        self._stopped = False
        self.late = 0.0
        targets = self.plant.targets
        targets.torque[:] = True
        targets.speed[:] = _SPEED
        targets.tension[:] = _TENSION

    def stop(self) -> None:
        """Let `run` end soon; for signal handlers and other threads."""
        self._stopped = True

    def run(self, on_ready: Callable[[], None] = lambda: None) -> None:
        """Serve until `stop` is called or the duration is over.

        Args:
            on_ready: is called when the port is open.

        Raises:
            S2C2AError: the port is taken.
            SimulationError: the simulation diverged.
        """
        self.server.open()
        try:
            on_ready()
            start = time.monotonic()
            now = 0.0
            while not self._stopped and now < self._duration:
                self._wait(start)
                now = time.monotonic() - start
                self._advance(now)
                self.server.serve(now, self.poses)
        finally:
            self.server.close()

    def poses(self) -> Mapping[str, Pose]:
        """Return `T_world_body` of base and module ends; the world is the base."""
        return self.plant.poses()

    def _wait(self, start: float) -> None:
        """Sleep until a request arrives or something is due."""
        physics = self.late + self.plant.time + self.plant.chunk
        due = min(physics, self.server.next_time)
        timeout = due - (time.monotonic() - start)
        timeout = min(max(0.0, timeout), _LONGEST_SLEEP)
        select.select(self.server.files, [], [], timeout)

    def _advance(self, now: float) -> None:
        """Advance the physics by at most one chunk, towards the wall clock."""
        behind = now - self.late - self.plant.time
        if behind < self.plant.chunk:
            return
        if behind > _LATEST:
            self.late += behind - self.plant.chunk
        if self._babbling is not None:
            self.plant.targets.goal[:] = self._babbling.goals(self.plant.time)
        self.plant.advance()
