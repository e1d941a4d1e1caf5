"""Speed of the live page: start, control steps with viewers, drags, floods, long runs.

Figures stand beside the table, whose times are those of the whole scripts.
"""

import os
import shutil
import subprocess
import sys
import threading
import time
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest

from compilations import compilations
from s2c2a.arm import ArmGeometry
from s2c2a.live.cli.live import running_page

pytest.importorskip(
    "viser", reason="the live page is not installed: `pip install '.[live]'`"
)

import msgspec
import viser
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Origin, Subprotocol

from s2c2a.spaces import Stage

pytestmark = pytest.mark.cores(os.cpu_count())
CHROMIUM = (
    shutil.which("chromium")
    or shutil.which("chromium-browser")
    or shutil.which("google-chrome")
)
FLAGS = ["--headless", "--no-sandbox", "--enable-unsafe-swiftshader"]
"""A browser without a graphics card. `--use-angle=swiftshader` would have it compose
the page, too, through a card that it imitates: a third more of its time."""
WATCHING = str(Path(__file__).with_name("watching.py"))
SECONDS = 30.0
FLOOD = 10_000
RANDOM = np.random.default_rng(0)
SCENE = "canvas[data-engine]"
SCENES_DRAWN = """() => new Promise(done => {
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
"""How often a second the scene, meshes all of it, is drawn: the browser shows frames in
which it is not, too."""


@pytest.fixture(scope="module")
def live(request, tmp_path_factory):
    """The control process and its page."""
    arm = request.config.getoption("--arm")
    with running_page(arm, out=tmp_path_factory.mktemp("runs"), port=8191) as both:
        yield both


@pytest.fixture(scope="module")
def browser():
    """A headless one."""
    if CHROMIUM is None:
        pytest.skip("no chromium, chromium-browser or google-chrome on the path")
    api = pytest.importorskip(
        "playwright.sync_api",
        reason="playwright is not installed: `pip install '.[dev]'`",
    )
    with api.sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield opened
        opened.close()


@pytest.mark.asked("at most 6 s")
def test_second_start(benchmark, browser, request):
    """Time from the start of a process to the usable page in an open browser."""
    benchmark.pedantic(
        start_and_look,
        args=(browser, request.config.getoption("--arm")),
        rounds=1,
        warmup_rounds=1,
    )


@pytest.mark.asked("at most 2 cm 1.5 s after it stops, no oscillation")
def test_drag_of_20_cm_in_a_second(benchmark, live):
    after = benchmark.pedantic(drag, args=(live[0],))
    benchmark.extra_info |= {
        "tip from target [cm]": 100 * after[0],
        "at most from then on [cm]": 100 * after.max(),
    }


def test_control_steps_with_nobody_there(benchmark, live):
    watch_steps(benchmark, live[0])


@pytest.mark.asked("within 20 % of those without a browser")
def test_control_steps_with_three_watching_that_draw_elsewhere(benchmark, live):
    with readers(live[1], 3):
        watch_steps(benchmark, live[0])


@pytest.mark.asked("within 20 % of those without a browser")
def test_control_steps_with_three_browsers_that_draw_here(benchmark, live, browser):
    control, page = live
    tabs = [looking(browser, page.gate.address) for _ in range(3)]
    watch_steps(benchmark, control)
    for tab in tabs:
        tab.close()


@pytest.mark.asked("at least 20 scenes a second")
@pytest.mark.parametrize(
    "address", ["/", "/?fixedDpr=0.5"], ids=["whole", "half the resolution"]
)
def test_scenes_drawn_in_software(benchmark, live, browser, address):
    control, page = live
    tab = looking(browser, page.gate.address + address)
    tab.locator(SCENE).wait_for()
    with moving(control):
        before = page.frames
        began = time.perf_counter()
        benchmark.extra_info["drawn a second"] = benchmark.pedantic(
            tab.evaluate, args=(SCENES_DRAWN,)
        )
        benchmark.extra_info["sent a second"] = (page.frames - before) / (
            time.perf_counter() - began
        )
    tab.close()


@pytest.mark.asked("another origin is refused, control steps are unharmed")
def test_flood_of_10_000_messages(benchmark, live):
    control, page = live
    with (
        suppress(InvalidStatus),
        connect(
            f"ws://127.0.0.1:{page.gate.port}", origin=Origin("http://evil.example")
        ),
    ):
        pass
    assert page.gate.refused["origin"] == 1
    undisturbed = steps(control, 10.0)
    sender = threading.Thread(target=flood, args=(page,))
    sender.start()
    upset = benchmark.pedantic(steps, args=(control, 10.0))
    sender.join()
    benchmark.extra_info |= {
        "control step, 99 % [ms]": upset[0],
        "before [ms]": undisturbed[0],
    }


@pytest.mark.asked(
    "no NaN, no fault, no step beyond a limit, no compilation; memory flat"
)
def test_long_run_of_random_drags(benchmark, live, request):
    control = live[0]
    wander_for(control, 5.0)
    geometry = ArmGeometry.of(control.arm)
    bad = {"NaN or fault": 0, "beyond a limit": 0}
    sizes = [resident(control)]
    first = control.latest
    here = compilations()

    def check(snapshot) -> None:
        within = (snapshot.step.action >= geometry.action_low - 1e-9) & (
            snapshot.step.action <= geometry.action_high + 1e-9
        )
        bad["NaN or fault"] += (
            not np.isfinite(snapshot.states).all() or snapshot.stage is Stage.FAULT
        )
        bad["beyond a limit"] += not within.all()

    stop = control.watch(check)
    benchmark.pedantic(
        wander_for, args=(control, 60 * request.config.getoption("--minutes"))
    )
    stop()
    sizes.append(resident(control))
    compiled = f"{control.latest.compiled - first.compiled}, {compilations() - here}"
    memory = ", ".join(f"{size:.0f}" for size in sizes)
    benchmark.extra_info |= bad | {
        "compiled by control and page": compiled,
        "memory of both [MB], then": memory,
    }


def start_and_look(browser, arm: str) -> None:
    """Start the command, look at its page until it says who drives, end it."""
    command = [
        sys.executable,
        "-c",
        "from s2c2a.cli.main import main; main()",
        "live",
        "--arm",
        arm,
        "--port",
        "8190",
    ]
    user = {
        name: value for name, value in os.environ.items() if not name.startswith("JAX_")
    }
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, text=True, env=user
    ) as process:
        try:
            looking(browser, process.stdout.readline().split()[-1]).close()
        finally:
            process.terminate()


def looking(browser, address: str):
    """A tab on the page, when it says who drives."""
    tab = browser.new_page(viewport={"width": 1280, "height": 800})
    tab.goto(address)
    tab.get_by_text("drives").first.wait_for(timeout=120_000)
    return tab


def drag(control) -> np.ndarray:
    """Drag 20 cm in 1 s; distances of the tip from the target after 1.5 s more [m]."""
    scale = control.arm.length / 0.6
    start = scale * np.array([0.10, -0.10, 0.568])
    end = scale * np.array([0.10, 0.10, 0.568])
    control.ask(driven=True, task=None, target=start, obstacles=())
    time.sleep(3.0)
    rows = []
    began = time.perf_counter()
    stop = control.watch(rows.append)
    while (share := time.perf_counter() - began) < 1.0:
        control.ask(target=start + share * (end - start))
        time.sleep(0.02)
    control.ask(target=end)
    still = time.perf_counter()
    time.sleep(4.0)
    stop()
    return np.array([row.error for row in rows if row.step.moment - still > 1.5])


def watch_steps(benchmark, control) -> None:
    """Control steps while a target is dragged."""
    tail, late = benchmark.pedantic(steps, args=(control, SECONDS))
    benchmark.extra_info |= {
        "control step, 99 % [ms]": tail,
        "latest one behind its time [ms]": late,
    }


def steps(control, seconds: float) -> tuple[float, float]:
    """99th percentile of the steps' times, and how late the latest step came [ms]."""
    rows = []
    stop = control.watch(rows.append)
    wander_for(control, seconds)
    stop()
    late = np.diff([row.step.moment for row in rows]) - control.arm.control_period
    return 1e3 * float(
        np.percentile([row.step.tick_time for row in rows], 99)
    ), 1e3 * float(late.max())


def wander_for(control, seconds: float) -> None:
    """Drags to random places."""
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        wander(control)


def wander(control) -> None:
    """Half a second of a drag to a random position, at 50 messages a second."""
    start = np.array(control.request.target or (0.0, 0.0, control.arm.length))
    turn, out, high = RANDOM.uniform((-np.pi, 0.0, 0.5), (np.pi, 0.7, 1.1))
    end = control.arm.length * np.array([out * np.cos(turn), out * np.sin(turn), high])
    for share in np.linspace(0, 1, 25):
        control.ask(
            driven=True, stopped=False, task=None, target=start + share * (end - start)
        )
        time.sleep(0.02)


@contextmanager
def moving(control):
    """Something to see meanwhile."""
    done = threading.Event()

    def move() -> None:
        while not done.is_set():
            wander(control)

    mover = threading.Thread(target=move)
    mover.start()
    try:
        yield
    finally:
        done.set()
        mover.join()


@contextmanager
def readers(page, count: int):
    """Watchers in a process of their own that take everything in and draw nothing."""
    before = len(page.session.present)
    with subprocess.Popen(
        [sys.executable, WATCHING, str(page.gate.port), str(count)]
    ) as process:
        try:
            while len(page.session.present) < before + count:
                time.sleep(0.1)
            yield
        finally:
            process.terminate()


def flood(page) -> None:
    """Malformed messages, with a new connection after each rejection."""
    sent = 0
    address = f"ws://127.0.0.1:{page.gate.port}"
    form = {
        "origin": Origin(page.gate.address),
        "subprotocols": [Subprotocol(f"viser-v{viser.__version__}")],
    }
    while sent < FLOOD:
        with (
            suppress(ConnectionClosed, InvalidStatus, OSError),
            connect(address, **form, max_size=None) as sender,
        ):
            while sent < FLOOD:
                sent += 1
                sender.send(
                    RANDOM.bytes(64)
                    if sent % 2
                    else msgspec.msgpack.encode({"type": "ShareUrlRequest"})
                )


def resident(control) -> float:
    """Memory of this process and of the control process [MB]; NaN if unknown."""
    with suppress(OSError):
        pages = [
            int(Path(f"/proc/{one}/statm").read_text().split()[1])
            for one in ("self", control.process)
        ]
        return sum(pages) * os.sysconf("SC_PAGESIZE") / 1e6
    return float("nan")
