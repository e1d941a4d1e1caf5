"""Run the blocks of the documentation: `python -m tools.run_blocks [PAGE ...]`.

The blocks of a page run in order, in a fresh folder that has the folders of the
repository that pages use. `tools.pages` describes the marks of blocks. Results are kept
in a file, so that --resume continues an interrupted or failed run.
"""

import argparse
import json
import os
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from hashlib import sha256
from pathlib import Path
from typing import Self

from tools import pages
from tools.page_processes import BlockError, Process, PythonProcess
from tools.pages import ROOT, SHELLS, Block, PageError

RESULTS = Path("runs/blocks.json")
BLOCK_LIMIT = 600.0  # s
COPIED = ("examples",)
LINKED = ("benchmarks", "results", "tools")
SOURCES = ("src", "examples", "tools")
TERMINATED = 143  # exit status, as shells report the signal
TAIL = 30  # lines of the output of a failure

PASSED = "passed"
FAILED = "failed"
SKIPPED = "not run"
WRITTEN = "written"
NOT_REACHED = "not reached"


@dataclass(frozen=True)
class Result:
    """What became of a block."""

    place: str
    language: str
    outcome: str
    seconds: float = 0.0
    detail: str = ""
    """Reason of a skip or a failure."""
    output: str = ""
    """End of the output of a failure."""

    @property
    def line(self) -> str:
        """One line for the console."""
        what = f"{self.outcome:11} {self.seconds:6.1f} s  {self.place} {self.language}"
        return f"{what}: {self.detail}" if self.detail else what


class PageRun:
    """Runs the blocks of one page in a fresh folder."""

    def __init__(self, page: str, root: Path = ROOT, limit: float = BLOCK_LIMIT):
        """Prepare the folder.

        Args:
            page: its path, relative to the root.
            root: folder of the repository.
            limit: of one block [s].
        """
        self.file = (root / page).resolve()
        self.folder = Path(tempfile.mkdtemp(prefix=f"{self.file.stem}-"))
        self.limit = limit
        self._environment = environment_of_blocks()
        self._background: list[tuple[Block, Process]] = []
        self._python: PythonProcess | None = None
        provide_folders(root, self.folder)

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """End all processes and delete the folder."""
        self.end_background()
        if self._python is not None:
            self._python.stop()
        shutil.rmtree(self.folder, ignore_errors=True)

    def run(self, block: Block) -> Result | None:
        """Run a block; None if it is only shown, such as a table or a drawing."""
        if block.mark == pages.NOT_RUN:
            return Result(block.place, block.language, SKIPPED, detail=block.detail)
        if block.mark == pages.BACKGROUND_ENDS:
            self.end_background()
            return None
        work = self._work_of(block)
        if work is None:
            return None
        began = time.monotonic()
        outcome = WRITTEN if block.mark in (pages.FILE, pages.APPEND) else PASSED
        detail = output = ""
        try:
            work(block)
        except BlockError as error:
            outcome = FAILED
            detail = str(error)
            output = error.output
        seconds = time.monotonic() - began
        return Result(block.place, block.language, outcome, seconds, detail, output)

    def end_background(self) -> None:
        """Stop the programs in the background."""
        for _, process in self._background:
            process.stop()
        self._background.clear()

    def _work_of(self, block: Block) -> Callable[[Block], None] | None:
        if block.mark in (pages.FILE, pages.APPEND):
            return self._write
        if block.language == "python":
            return self._run_python
        if block.language not in SHELLS:
            return None
        if block.mark == pages.BACKGROUND:
            return self._start
        return self._run_shell

    def _write(self, block: Block) -> None:
        path = self.folder / block.detail
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("a" if block.mark == pages.APPEND else "w") as file:
            file.write(block.text)

    def _run_shell(self, block: Block) -> None:
        process = self._shell(block)
        try:
            status = process.wait(self.limit)
        except BlockError as error:
            raise BlockError(str(error), _tail(process.output)) from None
        finally:  # also if the reader interrupts this program
            process.stop()
        if status != 0:
            raise BlockError(f"exit status {status}", _tail(process.output))
        self._check_background()

    def _start(self, block: Block) -> None:
        process = self._shell(block)
        try:
            process.wait_until_ready()
        except BlockError as error:
            process.stop()
            raise BlockError(str(error), _tail(process.output)) from None
        self._background.append((block, process))

    def _run_python(self, block: Block) -> None:
        if self._python is None:
            self._python = PythonProcess(self.folder, self._environment)
        python = self._python
        try:
            python.execute(block, self.file, self.limit)
        except BlockError as error:
            if python.process.status is not None:
                self._python = None
                python.stop()
            raise BlockError(str(error), _tail(python.process.output)) from None

    def _shell(self, block: Block) -> Process:
        command = ["bash", "-e", "-o", "pipefail", "-c", block.text]
        return Process(command, self.folder, self._environment)

    def _check_background(self) -> None:
        """Report a program in the background that ended by itself with an error."""
        for block, process in self._background:
            if process.status not in (None, 0):
                raise BlockError(
                    f"the program of {block.place} ended with status {process.status}",
                    _tail(process.output),
                )


def provide_folders(root: Path, folder: Path) -> None:
    """Copy or link the folders of the repository that pages use."""
    for name in COPIED:
        if (root / name).is_dir():
            shutil.copytree(root / name, folder / name)
    for name in LINKED:
        if (root / name).is_dir():
            (folder / name).symlink_to((root / name).resolve())


def environment_of_blocks() -> dict[str, str]:
    """Environment variables: the same installation, no windows, plain output."""
    environment = dict(os.environ)
    programs = str(Path(sys.executable).parent.absolute())
    environment["PATH"] = os.pathsep.join([programs, environment.get("PATH", "")])
    paths = filter(None, environment.get("PYTHONPATH", "").split(os.pathsep))
    environment["PYTHONPATH"] = os.pathsep.join(
        str(Path(path).absolute()) for path in paths
    )
    environment |= {"MPLBACKEND": "Agg", "NO_COLOR": "1", "PYTHONUNBUFFERED": "1"}
    return environment


def digest_of_sources(root: Path = ROOT) -> str:
    """Digest of the code that the blocks run."""
    digest = sha256()
    for name in SOURCES:
        for path in sorted((root / name).rglob("*")):
            if path.suffix in (".py", ".toml", ".safetensors"):
                digest.update(path.relative_to(root).as_posix().encode())
                digest.update(path.read_bytes())
    return digest.hexdigest()


class Session:
    """Runs pages and keeps their results in a file."""

    def __init__(
        self,
        results: Path = RESULTS,
        root: Path = ROOT,
        keep_going: bool = False,
        block_limit: float = BLOCK_LIMIT,
        total_limit: float = float("inf"),
    ) -> None:
        """Begin the time.

        Args:
            results: JSON file.
            root: folder of the repository.
            keep_going: continue after a failure.
            block_limit: of one block [s].
            total_limit: after which no more blocks begin [s].
        """
        self.results = results
        self.root = root
        self.keep_going = keep_going
        self.block_limit = block_limit
        self.end = time.monotonic() + total_limit
        self.sources = digest_of_sources(root)
        self.stored = _load(results)

    def run(self, names: Sequence[str], resume: bool) -> list[Result]:
        """Run pages; with `resume`, take results of pages that have not changed."""
        all_results: list[Result] = []
        for name in names:
            blocks = pages.blocks_of(name, self.root)
            digest = sha256((self.sources + pages.digest_of(blocks)).encode())
            kept = self._kept(name, digest.hexdigest()) if resume else None
            if kept is not None:
                print(f"{'kept':11}           {name}: {len(kept)} blocks", flush=True)
                all_results += kept
                continue
            results = self._run_page(name, blocks)
            self._store(name, digest.hexdigest(), results)
            all_results += results
            if self._stops(results):
                break
        return all_results

    def _run_page(self, name: str, blocks: list[Block]) -> list[Result]:
        results: list[Result] = []
        with PageRun(name, self.root, self.block_limit) as page:
            for block in blocks:
                if time.monotonic() > self.end:
                    results.append(Result(block.place, block.language, NOT_REACHED))
                    break
                result = page.run(block)
                if result is None:
                    continue
                results.append(result)
                _print(result)
                if self._stops(results):
                    break
        return results

    def _stops(self, results: list[Result]) -> bool:
        return not self.keep_going and any(r.outcome == FAILED for r in results)

    def _kept(self, name: str, digest: str) -> list[Result] | None:
        """Results of an unchanged page that passed."""
        stored = self.stored.get(name)
        if stored is None or stored["digest"] != digest:
            return None
        results = [Result(**fields) for fields in stored["blocks"]]
        bad = (FAILED, NOT_REACHED)
        return None if any(r.outcome in bad for r in results) else results

    def _store(self, name: str, digest: str, results: list[Result]) -> None:
        blocks = [asdict(result) for result in results]
        self.stored[name] = {"digest": digest, "blocks": blocks}
        self.results.parent.mkdir(parents=True, exist_ok=True)
        self.results.write_text(json.dumps(self.stored, indent=1), encoding="utf-8")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run pages; exit status 1 if a block failed or was not reached."""
    options = _parser().parse_args(arguments)
    names = [_relative(name) for name in options.pages] or pages.all_pages()
    session = Session(
        options.results,
        keep_going=options.keep_going,
        block_limit=options.limit,
        total_limit=options.total,
    )
    began = time.monotonic()
    # an exception ends the programs of the blocks, too
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(TERMINATED))
    try:
        results = session.run(names, options.resume)
    except PageError as error:
        print(error, file=sys.stderr)
        return 1
    _print_summary(results, time.monotonic() - began, options.results)
    return int(any(r.outcome in (FAILED, NOT_REACHED) for r in results))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m tools.run_blocks",
        description="Run the commands and the Python code of the documentation.",
    )
    add = parser.add_argument
    add("pages", nargs="*", metavar="PAGE", help="Markdown files; by default all")
    add("--keep-going", action="store_true", help="continue after a failure")
    add("--resume", action="store_true", help="skip unchanged pages that passed")
    add("--limit", type=float, default=BLOCK_LIMIT, help="of one block [s]")
    add(
        "--total",
        type=float,
        default=float("inf"),
        help="no block begins after this time [s]; --resume continues",
    )
    add("--results", type=Path, default=RESULTS, help="JSON file of the results")
    return parser


def _relative(name: str) -> str:
    return Path(name).resolve().relative_to(ROOT).as_posix()


def _load(path: Path) -> dict:
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def _tail(output: str) -> str:
    return "\n".join(output.rstrip().splitlines()[-TAIL:])


def _print(result: Result) -> None:
    print(result.line, flush=True)
    if result.output:
        print("    " + result.output.replace("\n", "\n    "), flush=True)


def _print_summary(results: list[Result], seconds: float, path: Path) -> None:
    outcomes = Counter(result.outcome for result in results)
    counts = ", ".join(f"{count} {outcome}" for outcome, count in outcomes.items())
    block_time = sum(result.seconds for result in results)
    print(f"\n{counts or 'no blocks'}; {seconds:.0f} s, blocks {block_time:.0f} s")
    for result in results:
        if result.outcome in (FAILED, NOT_REACHED):
            print(result.line)
    reasons = Counter(r.detail for r in results if r.outcome == SKIPPED)
    for reason, count in reasons.most_common():
        print(f"not run: {count:3}  {reason}")
    print(f"results: {path}")


if __name__ == "__main__":
    sys.exit(main())
