"""Malicious files: links, huge sizes and pathological text are rejected."""

import builtins
import io
import os
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.cli.main import main
from s2c2a.data import load_recording
from s2c2a.episodes import Episode, EpisodeWriter, load_episodes, save_episodes
from s2c2a.errors import (
    ArmError,
    RecordingError,
    S2C2AError,
    StrategyError,
    TargetError,
)
from s2c2a.files.text import write_atomically
from s2c2a.lab.hardware.calibration import load_calibration
from s2c2a.lab.tracking.calibration import load_or_empty, load_tracking_calibration
from s2c2a.lab.tracking.tags.camera import load_camera
from s2c2a.lab.tracking.tags.capture import open_device
from s2c2a.lab.tracking.tags.layout import load_layout
from s2c2a.lab.tracking.tags.live_calibration import read_pictures
from s2c2a.logs import load_map
from s2c2a.logs.reading import read_table
from s2c2a.logs.tables import ColumnRequest
from s2c2a.strategies import load_networks, load_recipe
from s2c2a.strategies.files import stated_errors
from s2c2a.tasks import load_task, load_waypoints, waypoints_task
from s2c2a_experiments.table_files import load_rows

TWIN = load_arm("twin_arm")
READERS = {
    "x.episodes": load_recording,
    "x.safetensors": load_networks,
    "arm.toml": load_arm,
    "recipe.toml": load_recipe,
    "x.csv": load_waypoints,
    "results.json": load_rows,
}
AB = ColumnRequest(["a", "b"])
BY_PATH = READERS | {
    "map.toml": load_map,
    "recipe.csv": partial(load_task, arm=TWIN),
    "x.episodes.json": partial(load_calibration, arm=TWIN),
    "tracking.json": partial(load_tracking_calibration, arm=TWIN),
    "begun.json": partial(load_or_empty, arm=TWIN),
    "camera.json": load_camera,
    "camera.yaml": load_camera,
    "layout.json": load_layout,
    "picture.png": lambda path: read_pictures([Path(path)]),
    "video.avi": lambda path: open_device(str(path)),
    "first.episodes": load_episodes,
    "own.safetensors": stated_errors,
}
"""All that reads a file whose path the user gives, beside tables of logs."""
TABLES = {
    name: partial(read_table, request=AB)
    for name in ("t.csv", "t.npz", "t.mat", "t.jsonl")
}


STRANGE = {
    "empty": b"",
    "binary": bytes(range(256)) * 9,
    "json": b"[1, 2",
    "another table": b'strange = 1\nother = "x"\n',
    "utf-16": "name = 'x'".encode("utf-16"),
    "blank": b" " * 2_000_000 + b"\n\n",
}
JSON = {
    "null": b"null",
    "list": b"[3]",
    "no keys": b"{}",
    "no tags": b'{"tags": []}',
    "one key": b'{"arm": 1e400}',
    "digits": b"9" * 10_000,
    "deep": b"[" * 100_000,
}
KINDS = [
    (name, kind)
    for name in BY_PATH | TABLES
    for kind in ("folder", "missing", "pipe", *STRANGE, *JSON)
    if kind not in JSON or "json" in name
]


@pytest.fixture
def episode():
    """A few steps of the twin."""
    return Episode(TWIN, {"time": np.arange(4.0), "actions": np.zeros((4, 3, 3))})


def test_overwriting_a_link_keeps_its_target(gather, tmp_path):
    (tmp_path / "mine").write_text("of value")
    (tmp_path / "x.episodes").symlink_to("mine")
    with pytest.raises(RecordingError, match="exists"):
        gather("x.episodes")
    gather("x.episodes", overwrite=True)
    write_atomically("new", tmp_path / "x.episodes")
    assert (tmp_path / "mine").read_text() == "of value"


@pytest.mark.parametrize("mine", ["mine.txt", "mine.episodes"])
def test_recordings_are_not_resumed_through_links(gather, tmp_path, mine):
    gather("mine.episodes")
    (tmp_path / "mine.txt").write_text("of value")
    before = (tmp_path / mine).read_bytes()
    (tmp_path / "x.episodes").symlink_to(mine)
    with pytest.raises(
        RecordingError, match="is a link, and nothing is written through links"
    ):
        gather("x.episodes", resume=True)
    assert (tmp_path / mine).read_bytes() == before


@pytest.mark.parametrize("name", READERS)
@pytest.mark.parametrize(
    "target", ["/etc/passwd", "/dev/zero", "/proc/self/mem", "/etc", "nowhere"]
)
def test_every_reader_rejects_links_to_other_files(tmp_path, name, target):
    (tmp_path / name).symlink_to(target)
    with pytest.raises(S2C2AError):
        READERS[name](tmp_path / name)


@pytest.mark.parametrize(("name", "kind"), KINDS)
def test_every_reader_names_the_strange_file_that_it_rejects(tmp_path, name, kind):
    path = tmp_path / f"ä {name}"
    if kind == "folder":
        path.mkdir()
    elif kind == "pipe":
        os.mkfifo(path)
    elif kind != "missing":
        path.write_bytes((STRANGE | JSON)[kind])
    elif name == "begun.json":
        return
    with pytest.raises(S2C2AError, match=f"ä {name}"):
        (BY_PATH | TABLES)[name](str(path))


@pytest.mark.parametrize("name", [*BY_PATH, *TABLES])
def test_every_reader_names_the_file_that_it_may_not_read(tmp_path, name, monkeypatch):
    """For the superuser, who may read everything, opening has to fail otherwise."""
    path = tmp_path / f"ä {name}"
    path.write_text("x")

    def refusing(opener):
        def opened(file, *arguments, **options):
            if file in (path, str(path)):
                raise PermissionError(13, "Permission denied", str(file))
            return opener(file, *arguments, **options)

        return opened

    for module in (builtins, io, os):
        monkeypatch.setattr(module, "open", refusing(module.open))
    with pytest.raises(S2C2AError, match=f"ä {name}"):
        (BY_PATH | TABLES)[name](str(path))


@pytest.mark.parametrize(
    "name", ["ä.toml", "_.toml", "-.toml", "ωarm.toml", "x" * 90 + ".toml", "9 z.toml"]
)
def test_an_arm_is_copied_to_a_file_of_any_name(tmp_path, name):
    main(["arm", "copy", "twin_arm", str(tmp_path / name)])
    assert load_arm(tmp_path / name).modules == TWIN.modules


BOMBS = """
import sys
sys.path.insert(0, sys.argv[1])
from test_strange_files import READERS
from s2c2a.errors import S2C2AError

for path in sys.argv[2:]:
    try:
        READERS[path.rpartition("/")[2]](path)
    except S2C2AError:
        print("refused")
# ru_maxrss would include the parent process
status = dict(line.split(":", 1) for line in open("/proc/self/status"))
print(int(status["VmHWM"].split()[0]) // 1024)
"""


@pytest.mark.slow
def test_huge_files_are_rejected_before_they_are_read(tmp_path):
    paths = [tmp_path / name for name in READERS]
    for path in paths:
        path.write_bytes(b"S2C2A\n" if path.suffix == ".episodes" else b"")
        os.truncate(path, 5_000_000_000)
    command = [sys.executable, "-c", BOMBS, os.path.dirname(__file__), *map(str, paths)]
    output = subprocess.run(
        command, capture_output=True, text=True, check=True
    ).stdout.split()
    assert output[:-1] == ["refused"] * len(READERS)
    assert int(output[-1]) < 1500  # MB


def test_episodes_too_large_to_read_are_not_written(tmp_path, episode, monkeypatch):
    writer = EpisodeWriter.create(tmp_path / "x.episodes", TWIN, {})
    writer.append(episode)
    size = (tmp_path / "x.episodes").stat().st_size
    monkeypatch.setattr("s2c2a.episodes.blocks.MAX_BYTES", size)
    with pytest.raises(
        RecordingError, match=r"at most .* bytes a file.*1 whole ones are kept"
    ):
        writer.append(episode)
    writer.close()
    assert len(load_recording(tmp_path / "x.episodes").episodes) == 1
    with pytest.raises(RecordingError, match="cannot write"):
        save_episodes([episode] * 9, tmp_path / "y.episodes")


@pytest.mark.parametrize(
    "text",
    [
        "[" * 100_000,
        "a." * 100_000 + "a = 1",
        "x = " + "9" * 5000,
        "control_rate = 0x" + "f" * 9000,
        "a = {b = " * 9000,
        "gravity_direction = [1e308, 1e308, 0.0]",
        "\n".join(f"k{n} = 1" for n in range(60_000)),
    ],
    ids=["deep", "dotted", "digits", "hexadecimal", "tables", "huge", "keys"],
)
def test_malicious_toml_is_rejected(tmp_path, text):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(ArmError):
        load_arm(path)
    with pytest.raises(StrategyError):
        load_recipe(path)


@pytest.mark.slow
def test_tables_may_have_many_waypoints_up_to_a_limit(tmp_path, monkeypatch):
    path = tmp_path / "long.csv"
    rows = [f"{line / 20},0.1,{line / 1e7},0.5\n" for line in range(1, 40_001)]
    path.write_text("time,x,y,z\n" + "".join(rows))
    tracks = load_waypoints(path)
    assert len(waypoints_task("long", tracks, TWIN).goals) == 20_000
    monkeypatch.setattr("s2c2a.tasks.waypoints.MAX_COUNT", 39_999)
    with pytest.raises(TargetError, match="more than 39999 lines"):
        load_waypoints(path)


def test_a_table_with_too_many_modules_is_rejected(tmp_path):
    path = tmp_path / "many.csv"
    rows = [f"1,0,0,0.6,{module}\n" for module in range(50_000)]
    path.write_text("time,x,y,z,module\n" + "".join(rows))
    with pytest.raises(TargetError, match="names 50000 modules; an arm has at most 20"):
        load_waypoints(path)


OVERWRITES = {
    "copy": "arm copy twin_arm thesis.tex",
    "collect": "collect thesis.tex --episodes 1 --samples 5",
    "train": "train x.episodes --out thesis.tex",
    "pretrain": "pretrain --out thesis.tex",
    "identify": "identify x.episodes --arm twin_arm --out thesis.tex",
    "import": "import log.csv --map map.toml --out thesis.tex",
    "home": "motors home --arm twin_arm --out thesis.tex",
}
"""Every command with --overwrite that writes a single file."""


@pytest.mark.parametrize("command", OVERWRITES.values(), ids=OVERWRITES)
def test_overwrite_replaces_no_file_of_another_kind(
    command, tmp_path, monkeypatch, refusal
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "thesis.tex").write_text("of value")
    assert "thesis.tex" in refusal(*command.split(), "--overwrite")
    assert (tmp_path / "thesis.tex").read_text() == "of value"
