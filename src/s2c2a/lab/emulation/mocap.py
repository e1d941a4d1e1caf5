"""Event loop of emulated motion capture of a simulated arm, in real time."""

import socket
from collections.abc import Callable, Mapping

import numpy as np

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.errors import S2C2AError
from s2c2a.lab.emulation.mocap_server import MocapServer, StreamOptions
from s2c2a.lab.emulation.motive import Motive, MotiveOptions
from s2c2a.lab.emulation.plant import Cables, Plant
from s2c2a.lab.emulation.pose_datagrams import DatagramOptions, PoseDatagrams
from s2c2a.lab.emulation.qtm import Qtm, QtmOptions
from s2c2a.lab.emulation.real_time import RealTimeArm

PROTOCOLS: Mapping[str, tuple[type[StreamOptions], Callable[..., MocapServer]]] = {
    "natnet": (MotiveOptions, Motive),
    "qualisys": (QtmOptions, Qtm),
    "udp": (DatagramOptions, PoseDatagrams),
}
"""Options and server of each protocol."""
MOTIONS = ("none", "babble")
_SPEED = 0.1  # m/s
_TENSION = 100.0  # N
_FREQUENCIES = (0.03, 0.2)  # Hz
_SINES = 3
_LARGEST_BEND = 0.5  # share of the full bend
_RAMP = 2.0  # s; the motion begins slowly
_MOTION_STREAM = 16


class SlowMotion:
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

    def goals(self, now: float) -> Cables:
        """Return the displacements of the cables [m] at a time [s]."""
        geometry = self._geometry
        turns = 2 * np.pi * self._frequencies * now
        sines = np.sin(turns + self._phases)
        ramp = min(now / _RAMP, 1.0)
        bends = _LARGEST_BEND / np.sqrt(2) * ramp * sines.mean(axis=-1)
        actions = geometry.actions_at(bends)
        return np.clip(actions, geometry.action_low, geometry.action_high).ravel()


class MocapEmulator(RealTimeArm):
    """An arm, its motion, and motion capture that tracks base and module ends.

    Attributes:
        server: of the poses.
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
        plant = Plant(arm, fidelity, options.seed, payload, homed=True)
        super().__init__(plant, duration)
        self.server = dict(PROTOCOLS.values())[type(options)](
            list(self.plant.poses()), options
        )
        self._babbling = SlowMotion(arm, options.seed) if motion == "babble" else None
        targets = self.plant.targets
        targets.torque[:] = True
        targets.speed[:] = _SPEED
        targets.tension[:] = _TENSION

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
            self._loop()
        finally:
            self.server.close()

    @property
    def _files(self) -> list[int | socket.socket]:
        return [*self.server.files]

    def _next_time(self) -> float:
        return self.server.next_time

    def _serve_all(self) -> None:
        self._advance()
        self.server.serve(self.now, self.plant.poses)

    def advance_chunk(self) -> None:
        """Move the motors, and simulate one chunk."""
        if self._babbling is not None:
            self.plant.targets.goal[:] = self._babbling.goals(self.plant.time)
        self.plant.advance()
