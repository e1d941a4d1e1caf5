"""Blocks and command lines of the documentation, and the tool that runs them."""

import os
import time
from pathlib import Path

import pytest

from tools import pages
from tools.command_lines import CommandLine, command_lines, fault_of
from tools.page_processes import QUIET
from tools.pages import BACKGROUND_ENDS, NOT_RUN, PageError, all_pages, blocks_of
from tools.run_blocks import FAILED, NOT_REACHED, PASSED, SKIPPED, PageRun, Session

PAGES = all_pages()
QUICK = {"docs/guides/tracking.md": ["StateCheck"]}
"""Words of Python blocks that need no other block and take a second, by page."""
WAIT = 10.0  # s


@pytest.mark.parametrize("page", PAGES)
def test_every_command_line_of_a_page_parses(page):
    faults = {
        f"{line.place}: s2c2a {' '.join(line.words)}": fault_of(line)
        for line in command_lines(page)
    }
    assert not {line: fault for line, fault in faults.items() if fault}


@pytest.mark.parametrize("page", PAGES)
def test_every_block_of_a_page_has_a_valid_mark(page):
    for block in blocks_of(page):
        assert block.mark != NOT_RUN or block.detail


@pytest.mark.parametrize("page", QUICK)
def test_quick_python_blocks_run(page):
    blocks = [
        block
        for block in blocks_of(page)
        if block.language == "python" and any(w in block.text for w in QUICK[page])
    ]
    assert len(blocks) == len(QUICK[page])
    with PageRun(page, limit=WAIT) as run:
        for block in blocks:
            result = run.run(block)
            assert result.outcome == PASSED, result.output


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


def test_inline_code_may_leave_arguments_out_and_name_placeholders():
    assert parsed("collect", inline=True) == ""
    assert parsed("motors", inline=True) == ""
    assert parsed("arm random --seed N --strength S", inline=True) == ""
    assert "--bogus" in parsed("collect --bogus", inline=True)


@pytest.fixture
def page(tmp_path):
    """Write a page; return its name."""

    def write(*lines: str) -> str:
        (tmp_path / "page.md").write_text("\n".join(lines) + "\n")
        return "page.md"

    return write


def run_page(root: Path, name: str, **options):
    session = Session(root / "results.json", root, keep_going=True, **options)
    return session.run([name], resume=False)


def test_command_lines_are_found_in_blocks_and_in_text(page, tmp_path):
    name = page(
        "Run `s2c2a doctor | head`, or `run circle --video`; `s2c2a.runtime` is a module.",
        "```sh",
        "cd x && s2c2a run circle \\",
        "  --event '6 payload 0.05'   # s2c2a bogus",
        "echo s2c2a bogus",
        "```",
    )
    lines = command_lines(name, tmp_path)
    assert [line.words for line in lines] == [
        ("run", "circle", "--event", "6 payload 0.05"),
        ("doctor",),
        ("run", "circle", "--video"),
    ]
    assert [line.inline for line in lines] == [False, True, True]
    assert lines[0].place == "page.md:3"


def test_a_marked_block_is_skipped_and_its_reason_kept(page, tmp_path):
    name = page("<!-- not run: a real arm -->", "```sh", "exit 1", "```")
    (result,) = run_page(tmp_path, name)
    assert (result.outcome, result.detail) == (SKIPPED, "a real arm")


@pytest.mark.parametrize("mark", ["not run", "not run:", "not run: no time", "file"])
def test_a_mark_without_a_valid_reason_or_name_is_refused(page, tmp_path, mark):
    name = page(f"<!-- {mark} -->", "```sh", "true", "```")
    with pytest.raises(PageError, match=r"page\.md:3"):
        blocks_of(name, tmp_path)


def test_a_failure_is_reported_with_the_end_of_its_output(page, tmp_path):
    name = page("```sh", "echo reason", "false", "echo unseen", "```", "```sh", "```")
    failure, after = run_page(tmp_path, name)
    assert (failure.outcome, failure.output) == (FAILED, "reason")
    assert failure.place == "page.md:2"
    assert after.outcome == PASSED


def test_a_block_beyond_its_limit_is_stopped(page, tmp_path):
    name = page("```sh", "sleep 60", "```", "```python", "while True: pass", "```")
    results = run_page(tmp_path, name, block_limit=0.5)
    assert [result.detail for result in results] == ["took more than 0.5 s"] * 2


def test_python_blocks_share_a_namespace_and_errors_name_lines_of_the_page(
    page, tmp_path
):
    name = page(
        "```python",
        "x = 1",
        "```",
        "```python",
        "print(x)",
        "raise ValueError('wrong')",
        "```",
        "```python",
        "assert x == 1",
        "```",
    )
    first, second, third = run_page(tmp_path, name)
    assert first.outcome == third.outcome == PASSED
    assert second.outcome == FAILED
    assert 'page.md", line 6' in second.output


def test_files_are_written_into_the_folder_of_the_page(page, tmp_path):
    name = page(
        "<!-- file: a/b.toml -->",
        "```toml",
        "x = 1",
        "```",
        "<!-- append: a/b.toml -->",
        "```toml",
        "y = 2",
        "```",
        "```python",
        "assert open('a/b.toml').read() == 'x = 1\\ny = 2\\n'",
        "```",
    )
    assert run_page(tmp_path, name)[-1].outcome == PASSED


def test_commands_that_are_not_shown_run_first(page, tmp_path):
    name = page("<!-- run first:", "touch made", "-->", "```sh", "ls made", "```")
    assert [result.outcome for result in run_page(tmp_path, name)] == [PASSED] * 2


def test_a_background_program_runs_beside_later_blocks_and_is_ended(page, tmp_path):
    name = page(
        "<!-- in background -->",
        "```sh",
        f"echo $$ > {tmp_path}/pid; echo ready; sleep 600",
        "```",
        "```sh",
        f"kill -0 $(cat {tmp_path}/pid)",
        "```",
    )
    results = run_page(tmp_path, name)
    assert [result.outcome for result in results] == [PASSED] * 2
    assert results[0].seconds >= QUIET
    assert not runs(int((tmp_path / "pid").read_text()))


def test_a_background_program_that_ends_at_once_fails(page, tmp_path):
    name = page("<!-- in background -->", "```sh", "echo no; exit 3", "```")
    (result,) = run_page(tmp_path, name)
    assert (result.detail, result.output) == ("ended with status 3", "no")


def test_the_background_ends_where_the_page_says_so(page, tmp_path):
    name = page(
        "<!-- in background -->",
        "```sh",
        f"echo $$ > {tmp_path}/pid; echo ready; sleep 600",
        "```",
        f"<!-- {BACKGROUND_ENDS} -->",
        "```sh",
        f"! kill -0 $(cat {tmp_path}/pid) 2> /dev/null",
        "```",
    )
    assert [result.outcome for result in run_page(tmp_path, name)] == [PASSED] * 2


def test_questions_of_a_command_are_answered(page, tmp_path):
    name = page("```sh", "python3 -c \"assert input('Go? [y/N] ') == 'y'\"", "```")
    (result,) = run_page(tmp_path, name)
    assert result.outcome == PASSED


def test_resuming_keeps_pages_that_passed_until_they_change(page, tmp_path):
    count = tmp_path / "count"
    lines = ["```sh", f"echo >> {count}", "```"]
    name = page(*lines)
    for resume in (True, True):
        Session(tmp_path / "results.json", tmp_path).run([name], resume)
    assert count.read_text() == "\n"
    page(*lines, *lines)
    Session(tmp_path / "results.json", tmp_path).run([name], resume=True)
    assert count.read_text() == "\n" * 3


def test_no_block_begins_after_the_total_time(page, tmp_path):
    name = page("```sh", "true", "```")
    (result,) = run_page(tmp_path, name, total_limit=0.0)
    assert result.outcome == NOT_REACHED


def test_included_files_are_part_of_a_block(page, tmp_path):
    (tmp_path / "part.py").write_text("# [start:a]\nx = 1\n# [end:a]\ny = 2\n")
    name = page("```python", '--8<-- "part.py:a"', "```")
    assert blocks_of(name, tmp_path)[0].text == "x = 1\n"


def test_blocks_in_tabs_and_lists_lose_their_indent(page, tmp_path):
    name = page('=== "Tab"', "", "    ```sh", "    true", "    ```")
    (block,) = pages.blocks_of(name, tmp_path)
    assert block.text == "true\n"


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
