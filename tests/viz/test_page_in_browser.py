"""The replay page in a real browser, where one is installed."""

import html
import json
import re
import shutil
import subprocess

import numpy as np
import pytest
from matplotlib.image import imread

from s2c2a.viz import replay_page

CHROMIUM = (
    shutil.which("chromium")
    or shutil.which("chromium-browser")
    or shutil.which("google-chrome")
)
FIXED = (
    "--headless --no-sandbox --disable-gpu --disable-sync --hide-scrollbars "
    "--disable-quic --no-first-run --disable-background-networking "
    "--disable-component-update --virtual-time-budget=3000"
)
SIZES = [(1280, 800), (390, 844)]

# Measures overlaps and horizontal overflow inside the page.
PROBE = """<script>
const boxOf = (name) => document.querySelector(name).getBoundingClientRect();
const boxes = [".head", ".stage", ".player", ".panel"].map(boxOf);
const cross = (a, b) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1
  && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 1;
document.body.dataset.probe = JSON.stringify({
  overlaps: boxes.flatMap((a, i) => boxes.slice(i + 1).filter((b) => cross(a, b)))
    .length,
  sideways: document.documentElement.scrollWidth - innerWidth,
  errors: [...document.querySelectorAll(".trace .now")].map((e) => e.textContent),
  clock: document.getElementById("clock").textContent,
});
</script>
</body>"""

# Steps, plays and selects runs by keyboard, and records the results.
KEYS = """<script>
const options = { bubbles: true, cancelable: true };
const eventOf = (key) => new KeyboardEvent("keydown", { key, ...options });
const press = (key) => document.body.dispatchEvent(eventOf(key));
const label = () => document.getElementById("play").getAttribute("aria-label");
const after = [];
for (const key of ["ArrowRight", "ArrowRight", "ArrowLeft", "2", " "]) press(key);
after.push(label());
press(" "); after.push(label());
// Draw at once: a headless browser may end before its next frame.
dispatchEvent(new Event("resize"));
after.push(document.getElementById("clock").textContent);
const rows = [...document.querySelectorAll(".trace")];
after.push(rows.map((row) => row.getAttribute("aria-checked")).join());
document.body.dataset.probe = JSON.stringify(after);
</script>
</body>"""

# Chooses the last view, and records its name and what it sees of the arm's axis.
VIEW = """<script>
const last = [...document.querySelectorAll("#views button")].at(-1);
last.click();
const { right, up, back } = scene.camera;
const seen = [right, up, back].map((axis) => Math.round(axis[2]));
document.body.dataset.probe = JSON.stringify([last.textContent, seen, right, up]);
</script>
</body>"""


@pytest.fixture
def chromium(tmp_path):
    """Run a headless browser on a page."""
    if CHROMIUM is None:
        pytest.skip("no chromium, chromium-browser or google-chrome on the path")

    def run(page, *options, size=SIZES[0], moment="0"):
        profile = f"--user-data-dir={tmp_path / 'profile'}"
        window = f"--window-size={size[0]},{size[1]}"
        address = f"{page.as_uri()}#t={moment}"
        command = [CHROMIUM, *FIXED.split(), profile, window, *options, address]
        return subprocess.run(
            command, capture_output=True, text=True, timeout=120, check=True
        ).stdout

    return run


def body_data(dom: str) -> dict[str, str]:
    """The data attributes of the body."""
    tag = re.search(r"<body[^>]*>", dom)[0]
    return {
        name: html.unescape(value)
        for name, value in re.findall(r'data-(\w+)="([^"]*)"', tag)
    }


def with_script(page, script: str):
    """A copy of the page with a script at its end."""
    copy = page.with_name("probed.html")
    copy.write_text(
        page.read_text(encoding="utf-8").replace("</body>", script), encoding="utf-8"
    )
    return copy


@pytest.fixture
def page(traces, arm, tmp_path):
    """A page of three strategies."""
    summary = {"task": "circle", "controller": "s2c2a"}
    return replay_page(
        traces, arm, "A circle at 0.54 m", tmp_path / "page.html", summary
    )


@pytest.mark.slow
@pytest.mark.parametrize("size", SIZES)
def test_the_page_draws_without_an_error_and_nothing_overlaps(
    chromium, page, traces, size
):
    data = body_data(
        chromium(with_script(page, PROBE), "--dump-dom", size=size, moment="6.3")
    )
    assert "error" not in data
    assert data["ready"] == "true"
    probe = json.loads(data["probe"])
    assert (probe["overlaps"], probe["sideways"]) == (0, 0)
    assert probe["clock"] == "6.3 / 19.9 s"
    assert probe["errors"] == [
        f"{100 * trace.position_errors[63]:.2f} cm" for trace in traces
    ]


@pytest.mark.slow
@pytest.mark.parametrize("size", SIZES)
def test_the_page_states_the_steps_of_the_mean_and_nothing_overlaps(
    chromium, make_trace, arm, tmp_path, size
):
    traces = [
        make_trace(counted=np.arange(200) < 50),
        make_trace("unreached", counted=np.zeros(200, bool)),
    ]
    page = replay_page(traces, arm, "A circle", tmp_path / "page.html")
    dom = chromium(with_script(page, PROBE), "--dump-dom", size=size, moment="6.3")
    assert (
        f"mean {100 * traces[0].counted_errors.mean():.2f} cm outside the shade<" in dom
    )
    assert ">no step counts<" in dom
    probe = json.loads(body_data(dom)["probe"])
    assert (probe["overlaps"], probe["sideways"]) == (0, 0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("size", "stage_ends", "least"), [(SIZES[0], 690, 4500), (SIZES[1], 380, 1000)]
)
def test_the_arm_is_seen_in_the_colors_of_its_modules(
    chromium, page, tmp_path, size, stage_ends, least
):
    picture = tmp_path / "page.png"
    chromium(page, f"--screenshot={picture}", size=size, moment="6.3")
    pixels = imread(picture)[..., :3]
    stage = pixels[110:stage_ends, :900]
    for color in range(3):
        shown = stage[..., color]
        others = np.delete(stage, color, axis=-1).max(axis=-1)
        seen = np.sum((shown - others > 0.12) & (shown > 0.25))
        # a gray arm among colored paths has fewer green and blue pixels
        assert seen > least


def test_keys_step_play_and_select_runs(chromium, page):
    data = body_data(chromium(with_script(page, KEYS), "--dump-dom"))
    assert "error" not in data
    done = ["Pause", "Play", "0.1 / 19.9 s", "false,true,false"]
    assert json.loads(data["probe"]) == done


@pytest.mark.parametrize(
    ("gravity", "name"), [((0, 0, -1), "Top"), ((0, 0, 1), "Bottom")]
)
def test_the_view_along_a_vertical_arm_is_from_its_tip_and_says_from_where(
    chromium, traces, make_arm, tmp_path, gravity, name
):
    arm = make_arm(gravity_direction=gravity)
    page = replay_page(traces, arm, "A circle", tmp_path / "page.html")
    dom = chromium(with_script(page, VIEW), "--dump-dom")
    shown, seen, right, up = json.loads(body_data(dom)["probe"])
    # x runs to the right and y upward, as in the figures
    assert (shown, seen) == (name, [0, 0, 1])
    np.testing.assert_allclose([right, up], [(1, 0, 0), (0, 1, 0)], atol=0.01)


@pytest.mark.slow
def test_runs_with_gaps_or_a_single_step_are_drawn(
    chromium, make_arm, make_trace, tmp_path, drawn
):
    states = make_trace(modules=20, bend=0.05).states.copy()
    states[0] = np.nan
    states[50:60] = np.nan
    recorded = drawn("recorded", np.arange(200.0), states)
    single = drawn("one step", [4.0], states[1:2])
    for number, gravity in enumerate([(0, 0, 1), (1, 0, 0), (0, 0, 0)]):
        arm = make_arm(20, 8, gravity_direction=gravity)
        page = replay_page(
            [recorded, single], arm, "</script>", tmp_path / f"{number}.html"
        )
        data = body_data(chromium(page, "--dump-dom"))
        assert data == {"ready": "true"}
