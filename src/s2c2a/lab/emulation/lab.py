"""An emulated laboratory in a folder: arm file, servos and motion capture."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from s2c2a.arm import ArmSpec, Tracking, arm_to_toml, servos_of
from s2c2a.errors import S2C2AError
from s2c2a.files.text import read_text, write_atomically
from s2c2a.lab.emulation.emulator import Emulator, EmulatorOptions
from s2c2a.lab.emulation.motive import MotiveOptions

ARM_FILE = "arm.toml"
PORT = "port"
STATUS_FILE = "status.json"
SUFFIX = "-lab"
MAX_NAME = 64
HEADING = "# Written by `s2c2a emulate lab`, which replaces it at every start.\n\n"
WELCOME = """{name}: {servos} {protocol} servos on {port}; Motive, UDP {mocap}
in another terminal:
  s2c2a motors home --arm {arm}
  s2c2a motors check --arm {arm}
  s2c2a tracking latency --arm {arm} --robot {protocol}
  s2c2a tracking frames --arm {arm} --robot {protocol}
  s2c2a run circle --arm {arm} --robot {protocol} --strategy pcc --pace 0.5
Control-C ends it."""


@dataclass(frozen=True)
class Laboratory:
    """An emulated laboratory.

    Attributes:
        emulator: servos and motion capture of one simulated arm.
        welcome: what a user can do with it.
    """

    emulator: Emulator
    welcome: str


def open_lab(
    arm: ArmSpec, folder: Path, mocap: MotiveOptions, **options: Any
) -> Laboratory:
    """Write the arm file of a laboratory; its emulator does not run yet.

    Args:
        arm: without a table `[servos]`, ids count from 1.
        folder: for the arm file, the port and a status file.
        mocap: options of the motion capture.
        **options: other attributes of `EmulatorOptions`.

    Raises:
        S2C2AError: the arm cannot be driven by servos, an option is invalid, or the
            folder has an arm file that `open_lab` did not write.
    """
    path = folder / ARM_FILE
    if path.exists() and not path.read_text("utf-8", "replace").startswith(HEADING):
        raise S2C2AError(
            f"{path} is not an arm file of an emulated laboratory; choose another "
            "--folder"
        )
    status = folder / STATUS_FILE
    if status.exists() and not _is_status(status):
        raise S2C2AError(
            f"{status} is not the status of an emulated laboratory; choose another "
            "--folder"
        )
    link = folder / PORT
    if link.exists():
        raise S2C2AError(
            f"{link} leads to a port: another laboratory uses this folder. Choose "
            "another --folder, or delete the link if none runs"
        )
    link = folder.absolute() / PORT
    settings = EmulatorOptions(link=link, status_file=status, mocap=mocap, **options)
    emulator = Emulator(arm, settings)
    folder.mkdir(parents=True, exist_ok=True)
    write_atomically(HEADING + arm_to_toml(_in_lab(arm, emulator, mocap)), path)
    servos = servos_of(arm)
    welcome = WELCOME.format(
        name=arm.name,
        servos=len(emulator.servos),
        protocol=servos.protocol,
        port=folder / PORT,
        mocap=f"{mocap.command_port} and {mocap.data_port}",
        arm=path,
    )
    return Laboratory(emulator, welcome)


def _is_status(path: Path) -> bool:
    """Whether a file is one that a killed laboratory leaves, which may be replaced."""
    try:
        status = json.loads(read_text(path))
    except (S2C2AError, ValueError, RecursionError):
        return False
    return isinstance(status, dict) and {"packets", "plugged"} <= status.keys()


def _in_lab(arm: ArmSpec, emulator: Emulator, mocap: MotiveOptions) -> ArmSpec:
    """The arm with the ports and the tracker of the laboratory."""
    servos = servos_of(arm)
    links = [str(line.link) for line in emulator.lines]
    places = dict(zip(emulator.ports, links, strict=True))
    groups = tuple(
        group.model_copy(update={"port": group.port and places[group.port]})
        for group in servos.groups
    )
    port = places.get(servos.port, links[0])
    servos = servos.model_copy(update={"port": port, "groups": groups})
    ports = f"command_port={mocap.command_port},data_port={mocap.data_port}"
    tracking = Tracking(source=f"natnet:127.0.0.1,{ports}")
    # calibrations carry the name: those of a rehearsal must not drive the real arm
    name = arm.name[: MAX_NAME - len(SUFFIX)] + SUFFIX
    return arm.model_copy(update={"name": name, "servos": servos, "tracking": tracking})
