"""Commands `s2c2a emulate`: devices of a real arm, emulated for tests and rehearsals."""

import signal
from pathlib import Path

from tyro.extras import SubcommandApp

from s2c2a.arm import load_arm
from s2c2a.cli.console import Arm, FidelityName

app = SubcommandApp()


@app.command
def servos(
    arm: Arm = "twin_arm",
    fidelity: FidelityName = "fast",
    seed: int = 0,
    payload: float = 0.0,
    homed: bool = False,
    firmware: int = 52,
    link: Path | None = None,
    port_file: Path | None = None,
    duration: float = float("inf"),
) -> None:
    """Emulate the servos of an arm on a pseudo-terminal, with its physics behind.

    Args:
        arm: a preset or an arm file; without [servos], ids count from 1.
        fidelity: of the simulation.
        seed: random seed of slack, positions, noise and faults.
        payload: mass at the tip [kg].
        homed: start without slack in the cables.
        firmware: of the servos; from 52 on, indirect data are at 208, before at 224.
        link: symbolic link to the port, which keeps its name when the port is
            unplugged; by default in a new temporary folder.
        port_file: file to which the name of the port is written.
        duration: time after which the emulator ends [s].
    """
    from s2c2a.emulation import Emulator, EmulatorOptions

    options = EmulatorOptions(
        fidelity=fidelity,
        seed=seed,
        payload=payload,
        homed=homed,
        firmware=firmware,
        link=link,
        port_file=port_file,
        duration=duration,
    )
    emulator = Emulator(load_arm(arm), options)
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: emulator.stop())
    count = len(emulator.servos)
    emulator.run(lambda port: print(f"{count} servos: {port}", flush=True))
