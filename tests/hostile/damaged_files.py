"""Fuzz test: damaged files of every format that the package reads.

Each file is read in a child process that has little time and memory; one child reads
many. The same number damages the same bytes.
"""

import contextlib
import hashlib
import json
import os
import re
import resource
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

# a file; bytes beyond the start; bytes in all
SECONDS, MEMORY, MAX_RESIDENT = 20, 1_200_000_000, 1_500_000_000
STATUS = Path("/proc/self/status")
BAD = ("changed", "foreign", "hang", "crash", "memory")
NASTY = [
    *b"1e308 -1 nan inf -inf NaN Infinity 1e999 0 1e-320 99999999999999999999".split(),
    *b'true null "word" [[1]] {} "" "../../etc/passwd" "\\ud800" 1e5 0.25 3'.split(),
    *b'"F64" "I8" [0,0] [2,-1] 12,3,4 1979-05-27 \xff\xfe \xc0\x80'.split(),
    b"1" + b"0" * 400,
    b"9" * 5000,
    b"0x" + b"f" * 5000,
    b"[" * 9000,
    b"{a=" * 3000,
    b'{"a":' * 9000,
    b"a." * 40000 + b"a=1",
    "\u202e\ufeff\u0000é".encode(),
    b"A" * 70000,
    b"\n",
    b"\x00" * 40,
]
VALUE = rb'-?\d[\d.eE+-]*|"[^"\n]{0,200}"|[A-Za-z_]{3,}'
LINKS = ["/etc/passwd", "/dev/zero", "/dev/full", "/etc", "/proc/self/mem", "nowhere"]


@dataclass(frozen=True)
class Format:
    """A kind of file: valid ones, how one is read, and whether it is bound by a digest.

    `read` says what was read as words, one for each part that may be missing at the end
    of a file that grows.
    """

    name: str
    samples: Callable[[], list[bytes]]
    read: Callable[[Path], list[str]]
    digest: bool = False
    grows: bool = False
    sealed: Callable[[list[bytes]], bytes] | None = None
    opened: Callable[[bytes], list[bytes]] | None = None


def _said(*things) -> str:
    digest = hashlib.sha256()
    for thing in things:
        digest.update(
            thing.tobytes() + str((thing.dtype, thing.shape)).encode()
            if isinstance(thing, np.ndarray)
            else repr(thing).encode("utf-8", "backslashreplace")
        )
    return digest.hexdigest()


def _saved(write: Callable[[Path], object], name: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder) / name)
        return (Path(folder) / name).read_bytes()


def _episodes(whole: bool):
    from s2c2a.arm import load_arm
    from s2c2a.episodes import Episode, EpisodeWriter, save_episodes

    arm, random = load_arm("twin_arm"), np.random.default_rng(0)
    every = []
    for seed in range(4):
        columns = {
            "time": np.arange(12) / 10,
            "actions": random.normal(size=(12, 3, 3)),
            "sensor.states": random.normal(size=(12, 3, 6)),
        }
        every.append(Episode(arm, columns, {"seed": seed}))

    def grow(path: Path) -> None:
        writer = EpisodeWriter.create(path, arm, {"episodes": 4})
        for episode in every:
            writer.append(episode)
        writer.close()

    def save(path: Path) -> None:
        save_episodes(every, path, {"seed": 3})

    return [_saved(save if whole else grow, "x.episodes")]


def _read_recording(path: Path) -> list[str]:
    from s2c2a.data import load_recording

    made = load_recording(path)
    return [_said(made.arm, made.options)] + [
        _said(
            one.options,
            *(part for item in sorted(one.columns.items()) for part in item),
        )
        for one in made.episodes
    ]


def _opened(content: bytes) -> list[bytes]:
    from s2c2a.episodes.blocks import read_blocks

    with tempfile.TemporaryFile() as file:
        file.write(content)
        file.seek(0)
        return [content for content, _ in read_blocks(file, "sample")]


def _sealed(contents: list[bytes]) -> bytes:
    """Blocks with right digests: a stranger who means harm makes them so."""
    from s2c2a.episodes.blocks import write_block

    with tempfile.TemporaryFile() as file:
        before = b""
        for content in contents:
            before = write_block(file, content, before)
        file.seek(0)
        return file.read()


def _arms() -> list[bytes]:
    from s2c2a.arm.files import PRESETS

    return [path.read_bytes() for path in sorted(PRESETS.glob("*.toml"))]


def _read_arm(path: Path) -> list[str]:
    from s2c2a.arm import ArmGeometry, arm_from_toml, arm_to_toml, load_arm

    arm = load_arm(path)
    ArmGeometry.of(arm)
    assert arm_from_toml(arm_to_toml(arm)) == arm
    return [_said(arm)]


def _recipes() -> list[bytes]:
    from s2c2a.strategies import RECIPES, save_recipe

    return [
        _saved(lambda path, recipe=recipe: save_recipe(recipe, path), "x.toml")
        for recipe in RECIPES.values()
    ]


def _read_recipe(path: Path) -> list[str]:
    from s2c2a.strategies import load_recipe

    return [_said(asdict(load_recipe(path)))]


def _strategies() -> list[bytes]:
    import s2c2a.strategies

    weights = Path(s2c2a.strategies.__file__).parent / "weights"
    return [path.read_bytes() for path in sorted(weights.glob("*.safetensors"))]


def _read_strategy(path: Path) -> list[str]:
    import jax

    from s2c2a.strategies import load_networks

    made = load_networks(path)
    arrays = [
        np.asarray(leaf)
        for leaf in jax.tree_util.tree_leaves(made.networks)
        if hasattr(leaf, "shape")
    ]
    percent = {name: each.percent for name, each in made.trained.items()}
    return [_said(made.arm, made.recipe, made.seed, percent, *arrays)]


def _opened_strategy(content: bytes) -> list[bytes]:
    """Header and numbers."""
    begin = 8 + int.from_bytes(content[:8], "little")
    return [content[8:begin], content[begin:]]


def _sealed_strategy(parts: list[bytes]) -> bytes:
    """With a length and a digest that fit, where there is still one."""
    content = len(parts[0]).to_bytes(8, "little") + b"".join(parts)
    if not (found := re.search(rb'"digest":"([0-9a-f]{64})"', content)):
        return content
    blank = content.replace(found[1], b"0" * 64, 1)
    return content.replace(
        found[1], hashlib.blake2b(blank, digest_size=32).hexdigest().encode(), 1
    )


def _tables() -> list[bytes]:
    rows = "".join(f"{t},{0.01 * t},0.1,0.5,0,{t},1,{t % 2}\n" for t in range(1, 30))
    return [
        f"time,x,y,z,axis_x,axis_y,axis_z,module\n{rows}".encode(),
        b"time,x,y,z\n0,0,0,0.6\n1,0.1,0,0.58\n",
    ]


def _read_table(path: Path) -> list[str]:
    from s2c2a.arm import load_arm
    from s2c2a.tasks import load_waypoints, waypoints_task

    tracks, arm = load_waypoints(path), load_arm("twin_arm")
    task = waypoints_task("x", tracks, arm)
    goal = task.goals[-1]._asdict()
    assert np.isnan(goal.pop("preview")).all()
    assert all(np.isfinite(part).all() for part in goal.values())
    parts = [(one.module, one.times, one.positions, one.axes) for one in tracks]
    return [_said(*parts)]


def _results() -> list[bytes]:
    from s2c2a.evaluation.report import Row, save_rows

    names = {name: name for name in list(Row.__dataclass_fields__)[:8]}
    rows = [
        Row(**names, mean=mean, std_steps=0.5, seeds=(0, 1, 2))
        for mean in (1.5, float("inf"), -2.25)
    ]
    return [_saved(lambda path: save_rows(rows, path), "results.json")]


def _read_results(path: Path) -> list[str]:
    from s2c2a.evaluation.report import over_seeds
    from s2c2a_experiments.table_files import load_rows

    rows = load_rows(path)
    with np.errstate(all="ignore"):
        over_seeds([row.mean for row in rows] or [0.0])
    return [_said(rows)]


def _options(path: Path | None = None) -> list:
    from s2c2a.errors import S2C2AError
    from s2c2a.jobs.run_folder import MARKER, open_run_directory

    with tempfile.TemporaryDirectory() as name:
        folder, options = Path(name) / "run", {"task": "circle", "seeds": [0, 1]}
        open_run_directory(folder, "x", options, False)
        if path is None:
            return [(folder / MARKER).read_bytes()]
        (folder / MARKER).unlink()
        (folder / MARKER).symlink_to(path.absolute())
        with contextlib.suppress(S2C2AError):
            open_run_directory(folder, "x", options, False, resume=True)
            return [_said("gone on with")]
    raise S2C2AError("refused")


FORMATS = {
    one.name: one
    for one in (
        Format("saved.episodes", lambda: _episodes(True), _read_recording, digest=True),
        Format(
            "growing.episodes",
            lambda: _episodes(False),
            _read_recording,
            digest=True,
            grows=True,
        ),
        Format(
            "sealed.episodes",
            lambda: _episodes(True),
            _read_recording,
            sealed=_sealed,
            opened=_opened,
        ),
        Format("strategy.safetensors", _strategies, _read_strategy, digest=True),
        Format(
            "sealed.safetensors",
            _strategies,
            _read_strategy,
            sealed=_sealed_strategy,
            opened=_opened_strategy,
        ),
        Format("arm.toml", _arms, _read_arm),
        Format("recipe.toml", _recipes, _read_recipe),
        Format("waypoints.csv", _tables, _read_table),
        Format("results.json", _results, _read_results),
        Format("options.json", _options, _options),
    )
}


def damaged(content: bytes, random: np.random.Generator) -> bytes:
    """One to three kinds of damage, mostly one."""
    for _ in range([1, 1, 1, 2, 3][random.integers(5)]):
        content = DAMAGES[random.integers(len(DAMAGES))](bytearray(content), random)
    return content


def _place(content: bytearray, random) -> int:
    return int(random.integers(len(content) + 1))


def _flip(content, random) -> bytes:
    for _ in range(random.integers(1, 9) if content else 0):
        content[random.integers(len(content))] ^= 1 << random.integers(8)
    return bytes(content)


def _run(content, random) -> bytes:
    begin, count = _place(content, random), int(random.integers(1, 200))
    fill = [bytes(count), b"\xff" * count, random.bytes(count)][random.integers(3)]
    return bytes(content[:begin] + fill + content[begin + count :])


def _cut(content, random) -> bytes:
    begin, end = sorted((_place(content, random), _place(content, random)))
    parts = [content[:begin], content[:begin] + content[end:], content[begin:]]
    return bytes(parts[random.integers(3)])


def _insert(content, random) -> bytes:
    begin = _place(content, random)
    return bytes(content[:begin] + NASTY[random.integers(len(NASTY))] + content[begin:])


def _twice_or_swapped(content, random) -> bytes:
    """Blocks between two marks of the form, or lines, or anything."""
    mark = [b"S2C2A\n", b"\n", bytes(content[_place(content, random) :][:2])][
        random.integers(3)
    ]
    parts = bytes(content).split(mark) if mark else [bytes(content)]
    one, two = random.integers(len(parts), size=2)
    if random.integers(2):
        parts[one], parts[two] = parts[two], parts[one]
    else:
        parts.insert(two, parts[one])
    return mark.join(parts)


def _length(content, random) -> bytes:
    """A giant length where one stands, or anywhere."""
    stated = [found.end() for found in re.finditer(b"S2C2A\n", content)]
    marks = [0, *stated, _place(content, random)]
    begin = marks[random.integers(len(marks))]
    giants = [2**64 - 1, 2**63, 2**40, 5 * 10**9, 2**31, len(content)]
    giant = giants[random.integers(6)]
    return bytes(content[:begin] + giant.to_bytes(8, "little") + content[begin + 8 :])


def _value(content, random) -> bytes:
    """A number or a word where another stood."""
    found = list(re.finditer(VALUE, content[:200_000]))
    if not found:
        return bytes(content)
    one = found[random.integers(len(found))]
    other = NASTY[random.integers(len(NASTY))]
    return bytes(content[: one.start()] + other + content[one.end() :])


def _header(content: bytes, random) -> bytes:
    """Of safetensors, header or numbers damaged, the header's length right again."""
    count = int.from_bytes(content[:8], "little")
    header, numbers = content[8 : 8 + count], content[8 + count :]
    if random.integers(4):
        damage = _value if random.integers(4) else damaged
        header = damage(bytearray(header), random)
    else:
        numbers = damaged(numbers, random)
    return len(header).to_bytes(8, "little") + header + numbers


DAMAGES = (_flip, _run, _cut, _insert, _twice_or_swapped, _length, *[_value] * 4)


def make(form: Format, number: int, samples: list[bytes], path: Path) -> int:
    """Write a damaged file (sometimes a link); return the number of its sample."""
    random = np.random.default_rng([number, *form.name.encode()])
    which = int(random.integers(len(samples)))
    path.unlink(missing_ok=True)
    if number % 200 == 7:
        path.symlink_to(LINKS[number // 200 % len(LINKS)])
    elif form.sealed and form.opened:
        contents = form.opened(samples[which])
        block = int(random.integers(len(contents)))
        contents[block] = (_header if block else damaged)(contents[block], random)
        path.write_bytes(form.sealed(contents))
    else:
        path.write_bytes(damaged(samples[which], random))
    return which


@contextlib.contextmanager
def limited_memory() -> Iterator[None]:
    """Let this program take `MEMORY` more than it has."""
    size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (size + MEMORY, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


def samples_of(form: Format, path: Path) -> tuple[list[bytes], list]:
    """Undamaged files of a format, and what is read from them."""
    samples = form.samples()
    said = []
    for sample in samples:
        path.write_bytes(sample)
        said.append(form.read(path))
    return samples, said


def child(folder: Path) -> None:
    """Make and read the files whose formats and numbers come in; say how that ended."""
    from s2c2a.errors import S2C2AError

    known_samples: dict[str, tuple[list[bytes], list]] = {}
    print("ready", flush=True)
    for line in sys.stdin:
        name, number = line.split()
        form = FORMATS[name]
        path = folder / f"x{os.getpid()}{Path(name).suffix}"
        if name not in known_samples:
            known_samples[name] = samples_of(form, path)
        samples, said = known_samples[name]
        which = make(form, int(number), samples, path)
        signal.alarm(SECONDS)
        try:
            with limited_memory():
                found = form.read(path)
            known = said[which]
            outcome = "another file" if not form.digest else "changed"
            if found == known:
                outcome = "unchanged"
            elif form.grows and known[: len(found)] == found:
                outcome = "cut short"
            told = ""
        except S2C2AError as error:
            outcome, told = "our error", str(error)[:300]
        except MemoryError:
            outcome, told = "memory", ""
        except BaseException as error:  # whatever else it may be
            outcome, told = "foreign", f"{type(error).__name__}: {error}"[:300]
        signal.alarm(0)
        answer = {"outcome": outcome, "told": told, "resident": max_resident()}
        print(json.dumps(answer), flush=True)


def max_resident() -> int:
    """Peak memory of this program [bytes]; `getrusage` would include its parent's."""
    (peak,) = re.findall(r"^VmHWM:\s*(\d+)", STATUS.read_text(), re.MULTILINE)
    return 1024 * int(peak)


class Reader:
    """A child that reads files, born again whenever it dies."""

    def __init__(self, folder: Path):
        self.command = [sys.executable, __file__, str(folder)]
        self.child: subprocess.Popen | None = None

    def read(self, name: str, number: int) -> dict:
        """How the file of this format and number ended."""
        if self.child is None:
            own = {"JAX_PLATFORMS": "cpu", "PYTHONWARNINGS": "ignore"}
            pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
            self.child = subprocess.Popen(
                self.command, text=True, env=os.environ | own, **pipes
            )
            assert self.child.stdout.readline() == "ready\n"
        self.child.stdin.write(f"{name} {number}\n")
        self.child.stdin.flush()
        answer = self.child.stdout.readline()
        if answer:
            return json.loads(answer)
        code = self.close()
        outcome = "hang" if code == -signal.SIGALRM else "crash"
        return {"outcome": outcome, "told": str(code), "resident": 0}

    def close(self) -> int:
        """Let it go."""
        if self.child is None:
            return 0
        self.child.stdin.close()
        code, self.child = self.child.wait(), None
        return code


def read_all(reader: Reader, name: str, numbers: range) -> list[tuple[int, dict]]:
    """Files that ended badly or took too much memory."""
    answers = {number: reader.read(name, number) for number in numbers}
    return [
        (number, answer)
        for number, answer in answers.items()
        if answer["outcome"] in BAD or answer["resident"] > MAX_RESIDENT
    ]


if __name__ == "__main__":
    child(Path(sys.argv[1]))
