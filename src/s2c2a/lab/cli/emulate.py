"""Commands `s2c2a emulate`: devices of a real arm, emulated for tests and rehearsals."""

import signal
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro
from tyro.extras import SubcommandApp

from s2c2a.arm import load_arm
from s2c2a.cli.console import Arm, FidelityName, OptionalPath
from s2c2a.cli.dependent_options import beside, effective
from s2c2a.errors import S2C2AError, counted

if TYPE_CHECKING:
    from s2c2a.lab.emulation.motive import MotiveOptions
    from s2c2a.lab.emulation.real_time import RealTimeArm

app = SubcommandApp()
command = app, "Emulate the devices of a real arm."

_FAULT = tyro.conf.arg(name="fault", metavar="'TIME KIND ARGUMENTS'")
Faults = Annotated[tuple[str, ...], _FAULT, tyro.conf.UseAppendAction]
_MOCAP_FAULT = tyro.conf.arg(name="mocap-fault", metavar="'TIME KIND ARGUMENTS'")
MocapFaults = Annotated[tuple[str, ...], _MOCAP_FAULT, tyro.conf.UseAppendAction]


def _stop_at_signals(emulator: "RealTimeArm") -> None:
    """Let Control-C and `kill` end an emulator."""
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: emulator.stop())


def _motive_options(data_port: int, **options: Any) -> "MotiveOptions":
    """Options of a Motive whose command port is the one below its data port."""
    from s2c2a.lab.emulation.motive import MotiveOptions

    return MotiveOptions(command_port=data_port - 1, data_port=data_port, **options)


@app.command
@beside("mocap_port", "mocap_rate", "mocap_latency", "mocap_noise")
@effective(
    "pose_rate",
    where="with --poses-to or --record",
    holds=lambda given: given["poses_to"] or given["record"],
)
def servos(
    arm: Arm = "twin_arm",
    fidelity: FidelityName = "fast",
    seed: int = 0,
    payload: float = 0.0,
    homed: bool = False,
    firmware: int = 52,
    faults: Faults = (),
    link: OptionalPath = None,
    port_file: OptionalPath = None,
    status_file: OptionalPath = None,
    poses_to: str = "",
    pose_rate: float = 100.0,
    record: OptionalPath = None,
    mocap_port: int = 0,
    mocap_rate: float = 120.0,
    mocap_latency: float = 0.0,
    mocap_noise: float = 0.0,
    duration: float = float("inf"),
) -> None:
    """Emulate the servos of an arm on a pseudo-terminal, with its physics behind.

    Args:
        seed: random seed of slack, positions, noise and faults.
        payload: mass at the tip [kg].
        homed: start without slack in the cables.
        firmware: of Dynamixel servos; from 52 on, indirect data are at 208, before at
            224.
        faults: a fault, such as "3 gone 4 1.5"; can be repeated. The time [s] counts
            from the start, and from the first torque on if it reads torque+3. Kinds:
            lost SHARE, corrupted SHARE, late SECONDS SHARE, garbage SHARE, stuffed ID,
            gone ID [SECONDS], reboot ID, hot ID, overload ID, stalled ID, snapped ID,
            voltage VOLTS, unplug SECONDS [ID].
        link: symbolic link to the port, which keeps its name when the port is
            unplugged; by default in a new temporary folder.
        port_file: file to which the names of the ports are written, one a line.
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
    from s2c2a.lab.emulation.emulator import Emulator, EmulatorOptions

    mocap = None
    if mocap_port:
        mocap = _motive_options(
            mocap_port,
            rate=mocap_rate,
            latency=mocap_latency,
            noise=mocap_noise,
            seed=seed,
        )
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
        mocap=mocap,
        duration=duration,
    )
    emulator = Emulator(load_arm(arm), options)
    _stop_at_signals(emulator)
    count = len(emulator.servos)
    emulator.run(lambda port: print(f"{counted(count, 'servo')}: {port}", flush=True))


@app.command
def lab(
    arm: Arm = "twin_arm",
    folder: Path = Path("lab"),
    payload: float = 0.0,
    homed: bool = False,
    faults: Faults = (),
    mocap_faults: MocapFaults = (),
    mocap_latency: float = 0.008,
    mocap_noise: float = 0.0002,
    mocap_rate: float = 120.0,
    mocap_port: int = 1511,
    fidelity: FidelityName = "fast",
    seed: int = 0,
    duration: float = float("inf"),
) -> None:
    """Emulate a whole laboratory: an arm, its servos, and motion capture.

    The arm file in the folder names the emulated port and the motion capture, so that
    all other commands work as with a real arm: `s2c2a motors home --arm lab/arm.toml`.

    Args:
        folder: for the arm file, the port and a status file.
        payload: mass at the tip [kg].
        homed: start without slack in the cables.
        faults: of servos and line, as in `emulate servos`; can be repeated.
        mocap_faults: of the motion capture, as in `emulate mocap`; can be repeated.
        mocap_latency: from exposure to transmission [s].
        mocap_noise: standard deviation of positions [m].
        mocap_rate: frames a second [Hz].
        mocap_port: UDP port of the frames; requests go to the port below it.
        seed: random seed of slack, positions, noise and faults.
        duration: time after which the emulator ends [s].
    """
    from s2c2a.lab.emulation.lab import open_lab

    mocap = _motive_options(
        mocap_port,
        rate=mocap_rate,
        noise=mocap_noise,
        latency=mocap_latency,
        faults=mocap_faults,
        seed=seed,
    )
    laboratory = open_lab(
        load_arm(arm),
        folder,
        mocap,
        payload=payload,
        homed=homed,
        faults=faults,
        fidelity=fidelity,
        seed=seed,
        duration=duration,
    )
    _stop_at_signals(laboratory.emulator)
    laboratory.emulator.run(lambda _: print(laboratory.welcome, flush=True))


def _of_protocols(options: tuple[str, ...], *protocols: str) -> Callable:
    where = " or ".join(f"--protocol {name}" for name in protocols)
    return effective(
        *options,
        where=f"with {where}",
        holds=lambda given: given["protocol"] in protocols,
    )


@app.command
@_of_protocols(("command_port", "data_port", "multicast"), "natnet")
@_of_protocols(("port",), "qualisys")
@_of_protocols(("poses_to",), "udp")
@_of_protocols(("host",), "natnet", "qualisys")
def mocap(
    arm: Arm = "twin_arm",
    protocol: Literal["natnet", "qualisys", "udp"] = "natnet",
    version: str = "",
    up: Literal["", "y", "z"] = "",
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
    port: int = 22_223,
    poses_to: str = "127.0.0.1:9763",
    duration: float = float("inf"),
) -> None:
    """Emulate motion capture that tracks the base and the module ends of an arm.

    Args:
        protocol: natnet for OptiTrack Motive, qualisys for Qualisys Track Manager, udp
            for JSON datagrams.
        version: of the protocol: NatNet 3.1, 4.0, 4.1 (default) or 4.2; newest of QTM:
            1.25 (default), 1.20 or 1.8, which the tracker refuses.
        up: vertical axis of the stream; default: y for natnet, z otherwise.
        rate: frames a second [Hz].
        faults: a fault, such as "3 hidden end-2 1.5"; can be repeated. The time [s]
            counts from the start. Kinds: lost SHARE, late SECONDS SHARE, reordered
            SHARE, duplicated SHARE, garbage SHARE, incomplete SHARE, absurd SHARE,
            hidden BODY [SECONDS], frozen BODY [SECONDS], swapped BODY BODY,
            flipped BODY, millimeters, knocked METERS, restart SECONDS, drift PPM.
        noise: standard deviation of positions [m].
        latency: from exposure to transmission [s].
        motion: none, or babble for a slow random motion of the arm.
        seed: random seed of motion, noise and faults.
        payload: mass at the tip [kg].
        host: address on which it listens.
        command_port: UDP port for requests, of natnet.
        data_port: UDP port of the frames, for multicast, of natnet.
        multicast: group of the frames, such as 239.255.42.99; empty: unicast; of
            natnet.
        port: TCP port, of qualisys.
        poses_to: HOST:PORT of the receiver, of udp.
        duration: time after which the emulator ends [s].
    """
    from s2c2a.lab.emulation.mocap import PROTOCOLS, MocapEmulator
    from s2c2a.lab.emulation.outputs import parse_address

    if version and protocol == "udp":
        raise S2C2AError(f"--version {version}: udp has no versions; leave it out")
    addresses: dict[str, dict[str, Any]] = {
        "natnet": {
            "command_port": command_port,
            "data_port": data_port,
            "multicast": multicast,
        },
        "qualisys": {"port": port},
        "udp": {"receiver": parse_address(poses_to)},
    }
    # without them, the defaults of the protocol
    given = {"up": up, "version": version}
    make_options, _ = PROTOCOLS[protocol]
    options = make_options(
        rate=rate,
        noise=noise,
        latency=latency,
        faults=faults,
        host=host,
        seed=seed,
        **{name: value for name, value in given.items() if value},
        **addresses[protocol],
    )
    emulator = MocapEmulator(
        load_arm(arm), options, motion, fidelity, payload, duration
    )
    _stop_at_signals(emulator)
    emulator.run(lambda: print(emulator.server.label, flush=True))
