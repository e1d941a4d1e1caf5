"""Damaged files of every format, 20 or 150 each."""

import pytest
from damaged_files import FORMATS, Reader, read_all

from marks import slow_after


@pytest.fixture(scope="module")
def reader(tmp_path_factory):
    """One process for all formats: most of its time is its start."""
    started = Reader(tmp_path_factory.mktemp("damaged"))
    yield started
    started.close()


@pytest.mark.parametrize("count", slow_after(1, [20, 150]))
@pytest.mark.parametrize("name", FORMATS)
def test_damaged_files_are_read_correctly_or_raise_an_error_of_the_package(
    name, count, reader
):
    first = 1_000_000
    assert read_all(reader, name, range(first, first + count)) == []
