"""A few hundred damaged files of every format; `python tests/hostile/damaged_files.py --count 20000` reads more."""

import pytest
from damaged_files import BAD, FORMATS, MAX_RESIDENT, read_all


@pytest.mark.parametrize("name", FORMATS)
def test_no_damaged_file_is_read_wrongly_or_ends_otherwise_than_in_an_error_of_the_package(
    name, tmp_path
):
    counts, bad, slowest, resident = read_all(
        name, range(1_000_000, 1_000_150), tmp_path
    )
    assert counts.total() == 150
    assert not any(counts[ending] for ending in BAD), bad
    assert slowest < 10
    assert resident < MAX_RESIDENT
