"""What the live page must show, measured: start, control steps under watching browsers, drags, floods, long runs."""

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
import viser
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Origin, Subprotocol

from s2c2a.arm import ArmGeometry
from s2c2a.errors import S2C2AError
from s2c2a.live.page import LivePage
from s2c2a.live.process import ControlProcess
from s2c2a.live.snapshot import Control, Snapshot, Stage
from s2c2a.programs import compilations

FLAGS = ["--headless", "--no-sandbox", "--enable-unsafe-swiftshader"]
"""A browser without a graphics card. `--use-angle=swiftshader` would have it compose the page, too, through a card that
it imitates: a third more of its time."""
SECONDS = 30.0
FLOOD = 10_000
SCENE = "canvas[data-engine]"
_SCENES_DRAWN = """() => new Promise(done => {
  const gl = document.querySelector("SCENE").getContext("webgl2");
  const draw = gl.drawElements;
  let drawn = 0, anew = false;
  gl.drawElements = (...what) => { anew = true; draw.apply(gl, what); };
  const begin = performance.now();
  const tick = () => {
    drawn += anew;
    anew = false;
    const took = performance.now() - begin;
    if (took < 5000) return requestAnimationFrame(tick);
    gl.drawElements = draw;
    done(1000 * drawn / took);
  };
  requestAnimationFrame(tick);
})""".replace("SCENE", SCENE)
"""How often a second the scene, meshes all of it, is drawn: the browser shows frames in which it is not, too."""


class Figure(NamedTuple):
    """One line of the table: what, what it must be, what it is."""

    what: str
    asked: str
    found: str


def start_time(browser: Any, arm: str, port: int) -> Figure:
    """From the start of a process to the page that says who drives; the browser is open before."""
    began = time.perf_counter()
    command = [sys.executable, "-c", "from s2c2a.cli.main import main; main()", "live", "--arm", arm]
    process = subprocess.Popen([*command, "--port", str(port)], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        said = process.stdout.readline()
        if "http" not in said:
            raise S2C2AError("`s2c2a live` did not start; its own words are above")
        address = said.split()[-1]
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.goto(address)
        page.get_by_text("drives").first.wait_for(timeout=120_000)
        took = time.perf_counter() - began
        page.close()
    finally:
        process.terminate()
        process.wait(10)
    return Figure("start, second time, s", "at most 6", f"{took:.1f}")


def read_along(loop: Control, page: LivePage) -> list[Figure]:
    """Control steps while a target is dragged: with nobody there, and with three who take everything in."""
    alone = _ticks(loop, SECONDS, lambda: _wander(loop))
    with _reading(page, 3):
        read = _ticks(loop, SECONDS, lambda: _wander(loop))
    return [
        Figure("control step, 99th percentile, ms; latest one behind its time", "", f"{alone[0]:.1f}; {alone[1]:.0f}"),
        Figure("the same, three watching that draw elsewhere", "within 20 %", f"{read[0]:.1f}; {read[1]:.0f}"),
    ]


def watched(loop: Control, page: LivePage, browser: Any) -> list[Figure]:
    """The same with three browsers that draw here; and what they see."""
    tabs = [browser.new_page(viewport={"width": 1280, "height": 800}) for _ in range(3)]
    for tab in tabs:
        tab.goto(page.gate.address)
        tab.get_by_text("drives").first.wait_for(timeout=120_000)
    together = _ticks(loop, SECONDS, lambda: _wander(loop))
    for tab in tabs[1:]:
        tab.close()
    tabs[0].locator(SCENE).wait_for()
    with _moving(loop):
        rate, drawn = tabs[0].evaluate(_SCENES_DRAWN), _drawn(page)
        tabs[0].goto(f"{page.gate.address}/?fixedDpr=0.5")
        tabs[0].get_by_text("drives").first.wait_for(timeout=120_000)
        tabs[0].locator(SCENE).wait_for()
        coarse = tabs[0].evaluate(_SCENES_DRAWN)
    tabs[0].close()
    return [
        Figure(
            "the same, three browsers that draw here, in software",
            "within 20 %",
            f"{together[0]:.1f}; {together[1]:.0f}",
        ),
        Figure("scenes a second that one browser draws in software", "at least 20", f"{rate:.0f}"),
        Figure("the same at half the resolution (?fixedDpr=0.5)", "", f"{coarse:.0f}"),
        Figure("scenes a second that the page's process sends", "", f"{drawn:.0f}"),
    ]


def dragged(loop: Control) -> Figure:
    """20 cm in one second, then still: how far the tip is from the target 1.5 s later, and from then on."""
    scale = loop.arm.length / 0.6
    start, end = scale * np.array([0.10, -0.10, 0.568]), scale * np.array([0.10, 0.10, 0.568])
    loop.ask(driven=True, task=None, target=start, obstacles=())
    time.sleep(3.0)
    rows: list[Snapshot] = []
    stop = loop.watch(rows.append)
    began = time.perf_counter()
    while (share := time.perf_counter() - began) < 1.0:
        loop.ask(target=start + share * (end - start))
        time.sleep(0.02)
    loop.ask(target=end)
    still = time.perf_counter()
    time.sleep(4.0)
    stop()
    after = np.array([row.error for row in rows if row.moment - still > 1.5])
    return Figure(
        "drag of 20 cm in 1 s: tip from target 1.5 s after it stops, and at most from then on, cm",
        "at most 2",
        f"{100 * after[0]:.2f}, {100 * after.max():.2f}",
    )


def lasting(loop: ControlProcess, minutes: float) -> list[Figure]:
    """Random drags by a script for some minutes."""
    _wander_for(loop, 5.0)
    first, before = loop.latest, compilations()
    geometry, bad, sizes = ArmGeometry.of(loop.arm), [0, 0], [_resident(loop)]

    def check(snapshot: Snapshot) -> None:
        within = (snapshot.actions >= geometry.action_low - 1e-9) & (snapshot.actions <= geometry.action_high + 1e-9)
        bad[0] += not np.isfinite(snapshot.states).all() or snapshot.stage is Stage.FAILED
        bad[1] += not within.all()
        if snapshot.number % 600 == 0:
            sizes.append(_resident(loop))

    stop = loop.watch(check)
    _wander_for(loop, 60 * minutes)
    stop()
    sizes.append(_resident(loop))
    last = loop.latest
    assert first is not None  # the loop runs
    assert last is not None
    compiled = last.compiled - first.compiled, compilations() - before
    return [
        Figure(f"{minutes:g} min of random drags: steps with NaN or a fault", "0", str(bad[0])),
        Figure("steps beyond a limit", "0", str(bad[1])),
        Figure(
            "compilations after the first 5 s, by the control process and by the page's",
            "0; 0",
            "{}; {}".format(*compiled),
        ),
        Figure("memory of both, first and last, MB", "flat", f"{sizes[0]:.0f}, {sizes[-1]:.0f}"),
    ]


def flooded(loop: Control, page: LivePage) -> list[Figure]:
    """Another origin, and 10,000 malformed messages while the arm is driven."""
    with suppress(InvalidStatus), connect(f"ws://127.0.0.1:{page.gate.port}", origin=Origin("http://evil.example")):
        pass
    refused = page.gate.refused["origin"] == 1
    calm = _ticks(loop, 10.0, lambda: _wander(loop))
    flood = threading.Thread(target=_flood, args=(page,))
    flood.start()
    upset = _ticks(loop, 10.0, lambda: _wander(loop))
    flood.join()
    return [
        Figure("connection from another origin", "refused", "refused" if refused else "LET IN"),
        Figure(
            "control step, 99th percentile, under a flood of 10,000 messages, ms",
            "unharmed",
            f"{upset[0]:.1f}, {calm[0]:.1f} before",
        ),
    ]


def _flood(page: LivePage) -> None:
    sent, random = 0, np.random.default_rng(0)
    while sent < FLOOD:
        with (
            suppress(ConnectionClosed, InvalidStatus, OSError),
            connect(
                f"ws://127.0.0.1:{page.gate.port}",
                origin=Origin(page.gate.address),
                subprotocols=[Subprotocol(f"viser-v{viser.__version__}")],
                max_size=None,
            ) as browser,
        ):
            while sent < FLOOD:
                sent += 1
                browser.send(random.bytes(64) if sent % 2 else msgspec.msgpack.encode({"type": "ShareUrlRequest"}))


def _ticks(loop: Control, seconds: float, meanwhile: Callable[[], None]) -> tuple[float, float]:
    """99th percentile of the steps' times, and how late the latest step came [ms]."""
    rows: list[Snapshot] = []
    stop = loop.watch(rows.append)
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        meanwhile()
    stop()
    late = np.diff([row.moment for row in rows]) - loop.arm.control_period
    return 1e3 * float(np.percentile([row.tick_time for row in rows], 99)), 1e3 * float(late.max())


_RANDOM = np.random.default_rng(0)


def _wander(loop: Control) -> None:
    """Half a second of a drag to a random place, some of them out of reach, at 50 messages a second."""
    wish = loop.wish
    start = np.array(wish.target or (0.0, 0.0, loop.arm.length))
    turn, out, high = _RANDOM.uniform((-np.pi, 0.0, 0.5), (np.pi, 0.7, 1.1))
    end = loop.arm.length * np.array([out * np.cos(turn), out * np.sin(turn), high])
    for share in np.linspace(0, 1, 25):
        loop.ask(driven=True, stopped=False, task=None, target=start + share * (end - start))
        time.sleep(0.02)


def _wander_for(loop: Control, seconds: float) -> None:
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        _wander(loop)


@contextmanager
def _moving(loop: Control) -> Iterator[None]:
    """Something to see meanwhile."""
    done = threading.Event()

    def move() -> None:
        while not done.is_set():
            _wander(loop)

    mover = threading.Thread(target=move)
    mover.start()
    try:
        yield
    finally:
        done.set()
        mover.join()


@contextmanager
def _reading(page: LivePage, count: int) -> Iterator[None]:
    """Watchers in a process of their own that take everything in and draw nothing."""
    before = len(page.session.present)
    command = [sys.executable, "-m", "s2c2a.live.watching", str(page.gate.port), str(count)]
    process = subprocess.Popen(command)
    try:
        while len(page.session.present) < before + count:
            time.sleep(0.1)
        yield
    finally:
        process.terminate()
        process.wait(10)


def _drawn(page: LivePage) -> float:
    before = page.frames
    time.sleep(3.0)
    return (page.frames - before) / 3.0


def _resident(loop: ControlProcess) -> float:
    """Memory of this process and of the control process [MB]; NaN where the system does not say."""
    with suppress(OSError):
        pages = [int(Path(f"/proc/{one}/statm").read_text().split()[1]) for one in ("self", loop.process)]
        return sum(pages) * os.sysconf("SC_PAGESIZE") / 1e6
    return float("nan")
