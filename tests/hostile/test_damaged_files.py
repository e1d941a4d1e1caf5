"""Damaged files of every format, 150 each.

`python tests/hostile/damaged_files.py --count 20000` reads more.
"""

import pytest
from damaged_files import BAD, FORMATS, MAX_RESIDENT, read_all


@pytest.mark.parametrize("name", FORMATS)
def test_damaged_files_are_read_correctly_or_raise_an_error_of_the_package(
    name, tmp_path
):
    counts, bad, _, resident = read_all(name, range(1_000_000, 1_000_150), tmp_path)
    assert counts.total() == 150
    assert not any(counts[ending] for ending in BAD), bad
    assert resident < MAX_RESIDENT
