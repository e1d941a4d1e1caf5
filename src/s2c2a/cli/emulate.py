"""Commands `s2c2a emulate`: devices of a real arm, emulated for tests and rehearsals."""

import signal
from pathlib import Path
from typing import Annotated, Literal

import tyro
from tyro.extras import SubcommandApp

from s2c2a.arm import load_arm
from s2c2a.cli.console import Arm, FidelityName

app = SubcommandApp()

_FAULT = tyro.conf.arg(name="fault", metavar="'TIME KIND ARGUMENTS'")
Faults = Annotated[tuple[str, ...], _FAULT, tyro.conf.UseAppendAction]


@app.command
def servos(
    arm: Arm = "twin_arm",
    fidelity: FidelityName = "fast",
    seed: int = 0,
    payload: float = 0.0,
    homed: bool = False,
    firmware: int = 52,
    faults: Faults = (),
    link: Path | None = None,
    port_file: Path | None = None,
    status_file: Path | None = None,
    poses_to: str = "",
    pose_rate: float = 100.0,
    record: Path | None = None,
    mocap_port: int = 0,
    mocap_rate: float = 120.0,
    mocap_latency: float = 0.0,
    mocap_noise: float = 0.0,
    duration: float = float("inf"),
) -> None:
    """Emulate the servos of an arm on a pseudo-terminal, with its physics behind.

    Args:
        arm: a preset or an arm file; without [servos], ids count from 1.
        fidelity: of the simulation.
        seed: random seed of slack, positions, noise and faults.
        payload: mass at the tip [kg].
        homed: start without slack in the cables.
        firmware: of Dynamixel servos; from 52 on, indirect data are at 208, before at
            224.
        faults: a fault, such as "3 gone 4 1.5"; can be repeated. The time [s] counts
            from the start, and from the first torque on if it reads torque+3. Kinds:
            lost SHARE, corrupted SHARE, late SECONDS SHARE, garbage SHARE, stuffed ID,
            gone ID [SECONDS], reboot ID, hot ID, overload ID, stalled ID, snapped ID,
            voltage VOLTS, unplug SECONDS.
        link: symbolic link to the port, which keeps its name when the port is
            unplugged; by default in a new temporary folder.
        port_file: file to which the name of the port is written.
        status_file: JSON file with the state of the servos, written four times a
            second.
        poses_to: HOST:PORT to which true poses are sent, as JSON over UDP.
        pose_rate: poses a second, and rows a second of the record [Hz].
        record: CSV file with the true positions of the module ends.
        mocap_port: data port of an emulated Motive that tracks the same arm, as
            `emulate mocap` does; its command port is one less. 0: none.
        mocap_rate: frames of Motive a second [Hz].
        mocap_latency: of Motive, from exposure to transmission, relative to the
            encoders of the servos [s].
        mocap_noise: standard deviation of the positions in its frames [m].
        duration: time after which the emulator ends [s].
    """
    from s2c2a.emulation import Emulator, EmulatorOptions

    options = EmulatorOptions(
        fidelity=fidelity,
        seed=seed,
        payload=payload,
        homed=homed,
        firmware=firmware,
        faults=faults,
        link=link,
        port_file=port_file,
        status_file=status_file,
        poses_to=poses_to,
        pose_rate=pose_rate,
        record=record,
        mocap_port=mocap_port,
        mocap_rate=mocap_rate,
        mocap_latency=mocap_latency,
        mocap_noise=mocap_noise,
        duration=duration,
    )
    emulator = Emulator(load_arm(arm), options)
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: emulator.stop())
    count = len(emulator.servos)
    emulator.run(lambda port: print(f"{count} servos: {port}", flush=True))


@app.command
def mocap(
    arm: Arm = "twin_arm",
    version: Literal["3.1", "4.0", "4.1", "4.2"] = "4.1",
    up: Literal["y", "z"] = "y",
    rate: float = 120.0,
    faults: Faults = (),
    noise: float = 0.0,
    latency: float = 0.0,
    motion: Literal["none", "babble"] = "none",
    fidelity: FidelityName = "fast",
    seed: int = 0,
    payload: float = 0.0,
    host: str = "127.0.0.1",
    command_port: int = 1510,
    data_port: int = 1511,
    multicast: str = "",
    duration: float = float("inf"),
) -> None:
    """Emulate OptiTrack Motive that tracks the base and the module ends of an arm.

    Args:
        arm: a preset or an arm file.
        version: of NatNet; 4.2 is one that the tracker refuses.
        up: vertical axis of the stream.
        rate: frames a second [Hz].
        faults: a fault, such as "3 hidden end-2 1.5"; can be repeated. The time [s]
            counts from the start. Kinds: lost SHARE, late SECONDS SHARE, reordered
            SHARE, duplicated SHARE, garbage SHARE, hidden BODY [SECONDS], swapped BODY
            BODY, restart SECONDS, drift PPM.
        noise: standard deviation of positions [m].
        latency: from exposure to transmission [s].
        motion: none, or babble for a slow random motion of the arm.
        fidelity: of the simulation.
        seed: random seed of motion, noise and faults.
        payload: mass at the tip [kg].
        host: address on which it listens.
        command_port: UDP port for requests.
        data_port: UDP port of the frames, for multicast.
        multicast: group of the frames, such as 239.255.42.99; empty: unicast.
        duration: time after which the emulator ends [s].
    """
    from s2c2a.emulation.mocap import MocapEmulator
    from s2c2a.emulation.motive import MotiveOptions

    options = MotiveOptions(
        version=version,
        up=up,
        rate=rate,
        noise=noise,
        latency=latency,
        faults=faults,
        host=host,
        command_port=command_port,
        data_port=data_port,
        multicast=multicast,
        seed=seed,
    )
    emulator = MocapEmulator(
        load_arm(arm), options, motion, fidelity, payload, duration
    )
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: emulator.stop())
    place = f"{host}, UDP {command_port} and {data_port}"
    emulator.run(lambda: print(f"Motive, NatNet {version}: {place}", flush=True))
