"""Blocks and command lines of the documentation, and the plugin that runs them."""

import os
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from unittest import SkipTest

import pytest
from sybil import Document

from tools import ROOT, all_pages, page_blocks
from tools.command_lines import (
    CommandLine,
    command_lines,
    command_lines_in_code,
    fault_of,
)
from tools.page_blocks import PAGES, QUIET, BlockError

QUICK = {"docs/guides/tracking.md": ["StateCheck"]}
"""Words of Python blocks that need no other block and take a second, by page."""
WAIT = 10.0  # s
FAILURES = (Exception, SystemExit)


def name_of(page) -> str:
    return page.relative_to(ROOT).as_posix()


@contextmanager
def begun(page) -> Iterator[Document]:
    """A parsed page in its folder."""
    folder = os.getcwd()
    document = PAGES.parse(page)
    PAGES.setup(document.namespace)
    try:
        yield document
    finally:
        PAGES.teardown(document.namespace)
        os.chdir(folder)


def run_page(page) -> list[str]:
    """What became of each block: empty if it passed."""
    outcomes = []
    with begun(page) as document:
        for example in document:
            try:
                example.evaluate()
            except FAILURES as error:
                outcomes.append(f"{type(error).__name__}: {error}")
            else:
                outcomes.append("")
    return outcomes


def faults_of(lines: Iterable[CommandLine]) -> dict[str, str]:
    """Command lines that do not parse, and why."""
    found = [(line, fault_of(line)) for line in lines]
    return {f"{line.place}: {line.words}": fault for line, fault in found if fault}


@pytest.mark.parametrize("page", all_pages(), ids=name_of)
def test_every_command_line_of_a_page_parses(page):
    assert not faults_of(command_lines(page))


@pytest.mark.parametrize("folder", ["src", "experiments", "examples"])
@pytest.mark.parametrize("ending", ["py", "toml"])
def test_every_command_line_in_code_parses(folder, ending):
    files = sorted((ROOT / folder).rglob(f"*.{ending}"))
    lines = [line for file in files for line in command_lines_in_code(file)]
    assert lines
    assert not faults_of(lines)


@pytest.mark.parametrize("page", all_pages(), ids=name_of)
def test_every_block_of_a_page_has_a_valid_mark(page):
    PAGES.parse(page)


@pytest.mark.parametrize("page", QUICK)
def test_quick_python_blocks_run(page, monkeypatch):
    monkeypatch.setattr(page_blocks, "BLOCK_LIMIT", WAIT)
    with begun(ROOT / page) as document:
        words = QUICK[page]
        quick = [each for each in document if any(w in str(each.parsed) for w in words)]
        assert len(quick) == len(words)
        for example in quick:
            example.evaluate()


def parsed(text: str, inline: bool = False) -> str:
    return fault_of(CommandLine("page", tuple(text.split()), inline))


def test_a_command_line_that_parses_has_no_fault():
    assert parsed("run circle --arm twin_arm --seeds 2") == ""
    assert parsed("reproduce sensor-faults") == ""


def test_a_wrong_command_line_is_reported():
    assert "--bogus" in parsed("run circle --bogus 3")
    assert "invalid literal for int" in parsed("run circle --seeds many")
    assert "no command" in parsed("colect")
    assert "no command" in parsed("arm chek mine.toml")
    assert "Required options" in parsed("collect")
    assert "a command is missing" in parsed("motors")
    assert "'bogus' is no table" in parsed("reproduce bogus")


def test_inline_code_may_leave_arguments_out_and_name_placeholders():
    assert parsed("collect", inline=True) == ""
    assert parsed("motors", inline=True) == ""
    assert parsed("arm random --seed N --strength S", inline=True) == ""
    assert "--bogus" in parsed("collect --bogus", inline=True)


def test_command_lines_are_found_in_code(tmp_path):
    file = tmp_path / "arm.toml"
    file.write_text(
        "# Made by `s2c2a doctor`, or `run circle --project`; s2c2a is a name:\n"
        "#   s2c2a run circle \\\n"
        "#     --arm arm.toml\n"
    )
    assert [(line.words, line.inline) for line in command_lines_in_code(file)] == [
        (("run", "circle", "--arm", "arm.toml"), False),
        (("doctor",), True),
        (("run", "circle", "--project"), True),
    ]


@pytest.fixture
def page(tmp_path):
    """Write a page; return its file."""

    def write(*lines: str):
        (tmp_path / "page.md").write_text("\n".join(lines) + "\n")
        return tmp_path / "page.md"

    return write


def test_command_lines_are_found_in_blocks_and_in_text(page):
    lines = command_lines(
        page(
            "Run `s2c2a doctor | head`, or `run circle --project`; `s2c2a.runtime` is a module.",
            "```sh",
            "cd x && s2c2a run circle \\",
            "  --event '6 payload 0.05'   # s2c2a bogus",
            "echo s2c2a bogus",
            "```",
            "<!-- run first:",
            "s2c2a doctor",
            "-->",
        )
    )
    assert [line.words for line in lines] == [
        ("run", "circle", "--event", "6 payload 0.05"),
        ("doctor",),
        ("doctor",),
        ("run", "circle", "--project"),
    ]
    assert [line.inline for line in lines] == [False, False, True, True]
    assert [line.place.rpartition(":")[2] for line in lines] == ["3", "8", "1", "1"]


def test_a_marked_block_is_skipped_and_its_reason_kept(page):
    marked = page("<!-- not run: a real arm -->", "```sh", "exit 1", "```")
    assert run_page(marked) == [f"{SkipTest.__name__}: a real arm"]


@pytest.mark.parametrize("mark", ["not run", "not run:", "not run: no time", "file"])
def test_a_mark_without_a_valid_reason_or_name_is_refused(page, mark):
    with pytest.raises(BlockError, match=r"page\.md: line 2"):
        PAGES.parse(page(f"<!-- {mark} -->", "```sh", "true", "```"))


def test_a_failure_prints_its_output_and_later_blocks_run(page, capfd):
    failing = page("```sh", "echo reason", "false", "echo no", "```", "```sh", "```")
    assert run_page(failing) == ["BlockError: exit status 1", ""]
    assert capfd.readouterr().out == "reason\n"


def test_a_block_beyond_its_limit_is_stopped(page, monkeypatch):
    monkeypatch.setattr(page_blocks, "BLOCK_LIMIT", 0.5)
    slow = page("```sh", "sleep 60", "```", "```python", "while True: pass", "```")
    assert run_page(slow) == ["BlockError: took more than 0.5 s"] * 2


def test_python_blocks_share_a_namespace_and_errors_name_lines_of_the_page(page):
    second = "print(x)\nraise ValueError('wrong')"
    python = page("```python", "x = 1", "```", "```python", second, "```")
    with begun(python) as document:
        defining, failing = document
        defining.evaluate()
        with pytest.raises(ValueError, match="wrong") as error:
            failing.evaluate()
    last = error.traceback[-1]
    assert (last.path, last.lineno + 1) == (python, 6)


def test_files_are_written_into_the_folder_of_the_page(page):
    first = ["<!-- file: a/b.toml -->", "```toml", "x = 1", "```"]
    further = ["<!-- append: a/b.toml -->", "```toml", "y = 2", "```"]
    use = "assert open('a/b.toml').read() == 'x = 1\\ny = 2\\n'"
    written = page(*first, *further, "```python", use, "```")
    assert run_page(written) == [""] * 3


def test_a_module_of_one_page_is_not_that_of_the_next(page):
    for value in (1, 2):
        own = ["<!-- file: own_part.py -->", "```python", f"x = {value}", "```"]
        use = f"import own_part\nassert own_part.x == {value}"
        assert run_page(page(*own, "```python", use, "```")) == ["", ""]


def test_commands_that_are_not_shown_run_first(page):
    hidden = page("<!-- run first:", "touch made", "-->", "```sh", "ls made", "```")
    assert run_page(hidden) == ["", ""]


def background(folder) -> list[str]:
    """A block that goes on beside the others, and writes the number of its process."""
    program = f"echo $$ > {folder}/pid; echo ready; sleep 600"
    return ["<!-- in background -->", "```sh", program, "```"]


def test_a_background_program_runs_beside_later_blocks_and_is_ended(page, tmp_path):
    use = f"kill -0 $(cat {tmp_path}/pid)"
    beside = page(*background(tmp_path), "```sh", use, "```")
    began = time.monotonic()
    assert run_page(beside) == ["", ""]
    assert time.monotonic() > began + QUIET
    assert not runs(int((tmp_path / "pid").read_text()))


def test_a_background_program_that_ends_at_once_fails(page, capsys):
    ending = page("<!-- in background -->", "```sh", "echo no; exit 3", "```")
    assert run_page(ending) == ["BlockError: ended with status 3"]
    assert capsys.readouterr().out == "no\n\n"


def test_the_background_ends_where_the_page_says_so(page, tmp_path):
    end = "<!-- background ends -->"
    use = f"! kill -0 $(cat {tmp_path}/pid) 2> /dev/null"
    ended = page(*background(tmp_path), end, "```sh", use, "```")
    assert run_page(ended) == [""] * 3


def test_questions_of_a_command_are_answered(page):
    asking = page("```sh", "python3 -c \"assert input('Go? [y/N] ') == 'y'\"", "```")
    assert run_page(asking) == [""]


def test_blocks_in_tabs_and_lists_lose_their_indent(page):
    (region,) = PAGES.parse(page('=== "Tab"', "", "    ```sh", "    true", "    ```"))
    assert region.parsed == "true\n"


def runs(process: int) -> bool:
    """Whether a process runs; it may need a moment to end."""
    end = time.monotonic() + WAIT
    while time.monotonic() < end:
        try:
            os.kill(process, 0)
        except ProcessLookupError:
            return False
        time.sleep(0.05)
    return True
