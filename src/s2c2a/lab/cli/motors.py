"""Commands `s2c2a motors`: bring-up of a real arm, from ports to a calibration."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Annotated

import numpy as np
import tyro
from tyro.extras import SubcommandApp

from s2c2a.arm import ArmSpec, Servos, load_arm, servos_of
from s2c2a.cli.console import Arm, OptionalPath, print_table, progress_bar
from s2c2a.cli.emergency import stop_on_key
from s2c2a.errors import S2C2AError, counted
from s2c2a.files.text import check_replaceable

if TYPE_CHECKING:
    from s2c2a.lab.hardware.bring_up import BringUp
    from s2c2a.lab.hardware.bus import ServoBus, ServoInfo

app = SubcommandApp()
command = app, "Bring up the servos of a real arm."
Id = tyro.conf.Positional[Annotated[int, tyro.conf.arg(metavar="ID")]]
SeveralIds = Annotated[tuple[int, ...], tyro.conf.arg(metavar="ID ...")]
Ids = tyro.conf.Positional[SeveralIds]
Distance = tyro.conf.Positional[Annotated[float, tyro.conf.arg(metavar="MM")]]
PortName = Annotated[
    str,
    tyro.conf.arg(metavar="PORT", help="serial port; by default that of the arm file."),
]
MAX_LATENCY = 0.0025  # s; of the timer of a serial adapter


@app.command
def scan(arm: Arm = "twin_arm", port: PortName = "", all_rates: bool = False) -> None:
    """List the servos on a port, or the serial ports where none is known.

    Args:
        all_rates: search at every baud rate of the protocol.
    """
    from s2c2a.lab.hardware.bus import BusError
    from s2c2a.lab.hardware.presence import check_presence
    from s2c2a.lab.hardware.serial_line import list_ports

    spec = load_arm(arm)
    servos = servos_of(spec)
    lines = _lines_of(spec, port)
    if not any(table.port for table, _ in lines):
        ports = list_ports()
        if not ports:
            raise S2C2AError("no serial port is found; plug the adapter in")
        header = ("port", "device", "serial number")
        return print_table("Serial ports", header, ports, left_aligned=True)
    for table, ids in lines:
        # list the servos of one port
        fault = ""
        with _opened(table, table.port) as bus:
            rates = bus.baud_rates if all_rates else (table.baud_rate,)
            rows = []
            notes = []
            for rate in rates:
                bus.set_baud_rate(rate)
                for info in bus.scan():
                    place = servos.number_of(info.id)
                    cells = (info.id, info.model, info.firmware, rate, place)
                    rows.append(tuple(map(str, cells)))
                    if info.secondary_id is not None:
                        notes.append(
                            f"servo {info.id} also obeys id {info.secondary_id} (its "
                            "secondary id); jog, home and check ask, then switch that off"
                        )
            bus.set_baud_rate(table.baud_rate)
            try:
                check_presence(bus, ids, servos.number_of)
            except BusError as error:
                fault = str(error)
        if fault and not rows:
            raise S2C2AError(f"{table.port}: {fault}" if servos.groups else fault)
        title = f"Servos on {table.port}" if servos.groups else "Servos"
        print_table(title, ("id", "model", "firmware", "bit/s", "cable"), rows)
        for note in notes:
            print(note)
        _print_slow_adapter(table.port)
        if fault:
            print(f"at {table.baud_rate} bit/s, {fault}")


def _lines_of(spec: ArmSpec, port: str) -> list[tuple[Servos, list[int]]]:
    """Tables of servos, one for each port, with all ids on it; a given port alone."""
    servos = servos_of(spec)
    lines: dict[str, tuple[Servos, list[int]]] = {}
    for table, ids in servos.parts():
        lines.setdefault(table.port, (table, []))[1].extend(ids)
    if port in lines:
        return [lines[port]]
    if port:
        table, ids = lines.get(servos.port, next(iter(lines.values())))
        return [(table.model_copy(update={"port": port}), ids)]
    return list(lines.values())


def _print_slow_adapter(port: str) -> None:
    """Tell the user if the adapter collects bytes before it passes them on."""
    from s2c2a.lab.hardware.serial_line import latency_of

    latency = latency_of(port)
    if latency > MAX_LATENCY:
        print(
            f"the adapter keeps bytes for {1000 * latency:.0f} ms in every control step; "
            "set its latency timer to 1 ms (docs/guides/hardware.md, Computer)"
        )


@app.command
def setup(
    new_id: Id, arm: Arm = "twin_arm", port: PortName = "", yes: bool = False
) -> None:
    """Give an id and the arm's baud rate to the only servo on the bus.

    Connect one servo at a time. Repeat the command for every servo.

    Args:
        new_id: id that the servo gets.
        yes: do not ask.
    """
    spec = load_arm(arm)
    servos = servos_of(spec).of(new_id)
    target_rate = servos.baud_rate
    with _opened(servos, port) as bus:
        rate, info = _only_servo(bus)
        bus.check_model(info, servos.model, servos.model_number)
        question = (
            f"{info.model} with id {info.id} at {rate} bit/s gets id {new_id} and "
            f"{target_rate} bit/s"
        )
        if not _confirm(question, yes):
            raise S2C2AError("declined; nothing was changed")
        bus.assign(info.id, new_id, target_rate)
        bus.set_baud_rate(target_rate)
        found = [found.id for found in bus.scan([new_id])]
    if found != [new_id]:
        raise S2C2AError(f"servo {new_id} does not answer; repeat the command")
    print(f"servo {new_id} is set up: {servos_of(spec).number_of(new_id)}")


def _only_servo(bus: "ServoBus") -> "tuple[int, ServoInfo]":
    """Baud rate and identity of the only servo on the bus."""
    found: dict[int, tuple[int, ServoInfo]] = {}
    for rate in bus.baud_rates:
        bus.set_baud_rate(rate)
        for info in bus.scan():
            found.setdefault(info.id, (rate, info))
    if len(found) == 1:
        (only,) = found.values()
        bus.set_baud_rate(only[0])
        return only
    ids = sorted(found)
    raise S2C2AError(
        f"{len(found)} servos answer (ids {ids}); connect one servo at a time"
        if found
        else "no servo answers at any baud rate; check the power supply and the cable"
    )


@app.command
def jog(
    id: Id, mm: Distance, arm: Arm = "twin_arm", port: PortName = "", yes: bool = False
) -> None:
    """Move one cable a little.

    Args:
        id: its servo.
        mm: distance [mm]; positive pays the cable out, negative winds it in.
        yes: do not ask before the motion.
    """
    if not abs(mm) <= 50:
        raise S2C2AError(f"{mm:g} mm is too far; give at most 50 mm in one motion")
    with _bring_up(load_arm(arm), port, yes) as (bring_up, _):
        moved = bring_up.jog(id, mm / 1000)
    print(f"servo {id} moved its cable by {1000 * moved:+.2f} mm")


@app.command
def home(
    arm: Arm = "twin_arm",
    port: PortName = "",
    out: OptionalPath = None,
    repeat: int = 3,
    resume: bool = False,
    overwrite: bool = False,
    yes: bool = False,
) -> None:
    """Take up the slack of every cable; the straight arm is zero.

    The arm must stand straight. Every cable is wound in with a small current
    (`servos.home_current`), module by module.

    Args:
        out: calibration file; by default NAME.calibration.json in the current folder.
        repeat: homings of every module, of which the mean counts.
        resume: continue an interrupted homing.
        overwrite: replace a calibration that exists.
        yes: do not ask before every module.
    """
    from s2c2a.lab.hardware import calibration as files
    from s2c2a.lab.hardware.serial_line import adapter_of

    spec = load_arm(arm)
    path = out or files.default_path(spec)
    if path.exists() and not (resume or overwrite):
        raise S2C2AError(
            f"{path} exists; replace it (--overwrite), continue it (--resume), or "
            "choose another name (--out)"
        )
    if overwrite:
        check_replaceable(path, ".json")
    before = files.load_calibration(path, spec) if resume and path.exists() else None
    with _bring_up(spec, port, yes) as (bring_up, bus):
        calibration = bring_up.home(
            bus.scan(_ids_of(spec)),
            adapter=adapter_of(port or servos_of(spec).port),
            repeat=repeat,
            before=before,
            save=lambda unfinished: files.save_calibration(unfinished, path),
        )
    print(f"calibration: {path}")
    if calibration.spread:
        print(f"repeatability: {1000 * calibration.spread:.3f} mm (standard deviation)")
    calibration.check_repeatability()


@app.command
def check(
    arm: Arm = "twin_arm",
    port: PortName = "",
    calibration: OptionalPath = None,
    yes: bool = False,
) -> None:
    """Move every cable of a homed arm a little, and compare.

    Args:
        calibration: file of `motors home`; by default NAME.calibration.json.
        yes: do not ask before the motion.
    """
    from s2c2a.lab.hardware.calibration import default_path, load_calibration

    spec = load_arm(arm)
    homes = load_calibration(calibration or default_path(spec), spec)
    with _bring_up(spec, port, yes) as (bring_up, _):
        faults = bring_up.check(homes)
    ids = [id for id, fault in faults.items() if fault]
    if ids:
        raise S2C2AError(
            f"check the cables of servos {ids}, then repeat the command. If cables or "
            f"servos were moved without power or changed since {homes.date:%Y-%m-%d %H:%M} "
            "(UTC), their homes no longer fit: home again "
            "(`s2c2a motors home --overwrite`)"
        )
    print(f"all {counted(len(faults), 'cable')} move as they should")


@app.command
def reboot(ids: Ids, arm: Arm = "twin_arm", port: PortName = "") -> None:
    """Restart servos that have switched off; their torque is off afterwards.

    Args:
        ids: of the servos.
    """
    spec = load_arm(arm)
    with _opened(servos_of(spec), port) as bus:
        for id in ids:
            with _named_absence(bus, spec, [id]):
                bus.reboot(id)
            print(f"servo {id} restarts")


@app.command
def release(arm: Arm = "twin_arm", port: PortName = "") -> None:
    """Switch the torque of all servos off; a bent arm falls back."""
    spec = load_arm(arm)
    ids = _ids_of(spec)
    with _opened(servos_of(spec), port) as bus, _named_absence(bus, spec, ids):
        bus.set_torque(ids, on=False)
    print(f"the torque of {counted(len(ids), 'servo')} is off")


@app.command
def timing(
    arm: Arm = "twin_arm",
    port: PortName = "",
    rate: float = 50.0,
    cycles: int = 1000,
    fast_read: bool = False,
    yes: bool = False,
) -> None:
    """Measure how long the bus takes to send all goals and read all servos.

    The torque is off: nothing moves, and a bent arm falls back.

    Args:
        rate: cycles a second [Hz].
        cycles: number of cycles.
        fast_read: let all servos answer in one packet.
        yes: do not ask before stored settings of the servos change.
    """
    from s2c2a.lab.hardware.presence import check_presence
    from s2c2a.lab.hardware.timing import measure_timing, prepare_timing

    if not (1 <= rate <= 1000 and 1 <= cycles <= 1_000_000):
        raise S2C2AError(
            f"{counted(cycles, 'cycle')} at {rate:g} Hz were given; choose 1 to 1000 "
            "Hz and 1 to 1000000 cycles"
        )
    spec = load_arm(arm)
    servos = servos_of(spec)
    with _opened(servos, port, fast_read) as bus:
        bus.accept_stored = lambda changes: _confirm(changes, yes)
        check_presence(bus, _ids_of(spec), servos.number_of)
        prepare_timing(bus, servos)
        with progress_bar() as progress:
            result = measure_timing(bus, servos, rate, cycles, progress)
    quantiles = 1000 * np.quantile(result.durations, (0.5, 0.99, 1.0))
    print(
        "goals out and states in: median {:.2f} ms, 99 % {:.2f} ms, "
        "longest {:.2f} ms".format(*quantiles)
    )
    print(
        f"{result.late} of {cycles} cycles began late at {rate:g} Hz; in "
        f"{result.incomplete} a servo did not answer at the first request"
    )
    if fault := result.fault(servos.number_of):
        raise S2C2AError(f"failed: {fault}")
    print(f"ok: the bus is fit for {rate:g} Hz")


def _ids_of(spec: ArmSpec) -> list[int]:
    return [id for row in servos_of(spec).ids for id in row]


@contextmanager
def _opened(servos: Servos, port: str, fast_read: bool = False) -> "Iterator[ServoBus]":
    """Open the bus; the signal of an emergency stop works meanwhile."""
    from s2c2a.lab.hardware.buses import open_bus
    from s2c2a.runtime.emergency import EMERGENCY_STOP, stop_on_signal

    EMERGENCY_STOP.reset()
    with stop_on_signal(), open_bus(servos, port, fast_read) as bus:
        yield bus


@contextmanager
def _named_absence(bus: "ServoBus", spec: ArmSpec, ids: list[int]) -> Iterator[None]:
    """Tell silent and doubled servos apart where one did not answer."""
    from s2c2a.lab.hardware.bus import BusError
    from s2c2a.lab.hardware.presence import check_presence

    try:
        yield
    except BusError:
        check_presence(bus, ids, servos_of(spec).number_of, _ids_of(spec))
        raise


@contextmanager
def _bring_up(
    spec: ArmSpec, port: str, yes: bool
) -> "Iterator[tuple[BringUp, ServoBus]]":
    from s2c2a.lab.hardware.bring_up import BringUp
    from s2c2a.lab.hardware.bus import NO_WATCHDOG

    with _opened(servos_of(spec), port) as bus:
        if not bus.has_watchdog:
            print(NO_WATCHDOG)
        confirm = partial(_confirm, yes=yes)
        yield BringUp(bus, spec, confirm, print, stop_on_key), bus


def _confirm(motion: str, yes: bool) -> bool:
    """Announce what happens next; ask the operator unless they agreed before."""
    if yes:
        print(motion)
        return True
    if not sys.stdin.isatty():
        raise S2C2AError(f"next: {motion}. No terminal can answer; add --yes to agree")
    return input(f"{motion}. Continue? [y/N] ").strip().lower() in ("y", "yes")
