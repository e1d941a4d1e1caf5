"""A few hundred damaged files of every format; `python tests/hostile/damaged_files.py --count 20000` reads more."""

import pytest
from damaged_files import BAD, FORMATS, MOST_RESIDENT, read_all

from s2c2a.strategies.checkpoint import SCHEMA

WITHOUT_DIGEST = pytest.mark.xfail(SCHEMA < 2, reason="strategy files get their digest with schema 2")


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[WITHOUT_DIGEST] if name == "strategy.safetensors" else []) for name in FORMATS]
)
def test_no_damaged_file_is_read_wrongly_or_ends_otherwise_than_in_an_error_of_the_package(name, tmp_path):
    counts, bad, slowest, resident = read_all(name, range(1_000_000, 1_000_150), tmp_path)
    assert counts.total() == 150
    assert not any(counts[ending] for ending in BAD), bad
    assert slowest < 10
    assert resident < MOST_RESIDENT
