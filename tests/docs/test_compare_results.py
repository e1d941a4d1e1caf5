"""Rows that were made now beside those of `results/`."""

import json
from pathlib import Path

import pytest

from tools.compare_results import differing, load_rows, main
from tools.results_tables import RESULTS


@pytest.fixture
def published():
    return load_rows(RESULTS / "best")


def changed(rows, change):
    return {names: row | {"mean": change(row)} for names, row in rows.items()}


def test_equal_rows_do_not_differ(published):
    assert published
    assert not differing(published, published)


def test_a_row_differs_beyond_its_spread(published):
    accuracy = {
        names: row for names, row in published.items() if row["unit"] not in ("ms", "")
    }
    spread = {names: row for names, row in accuracy.items() if row["std_seeds"]}
    within = changed(spread, lambda row: row["mean"] + 3.9 * row["std_seeds"])
    beyond = changed(spread, lambda row: row["mean"] + 4.1 * row["std_seeds"])
    assert not differing(within, published)
    assert len(differing(beyond, published)) == len(spread)


def test_a_lost_value_differs(published):
    names = next(names for names, row in published.items() if row["unit"] == "cm")
    lost = changed({names: published[names]}, lambda row: float("nan"))
    (line,) = differing(lost, published)
    assert all(name in line for name in names if name)


def test_rows_of_one_name_are_equal():
    """Otherwise one would stand for another."""
    known: dict = {}
    for folder in filter(Path.is_dir, RESULTS.iterdir()):
        for names, row in load_rows(folder).items():
            assert known.setdefault(names, row) == row, names


@pytest.mark.parametrize(("change", "code"), [(0.0, 0), (1e3, 1), (None, 1)])
def test_the_command_fails_where_rows_differ_or_are_missing(
    change, code, tmp_path, monkeypatch, capsys
):
    rows = json.loads((RESULTS / "best" / "interaction.json").read_text("utf-8"))
    (tmp_path / "interaction").mkdir()
    if change is not None:
        moved = [row | {"mean": row["mean"] + change} for row in rows]
        (tmp_path / "interaction" / "rows.json").write_text(json.dumps(moved))
    monkeypatch.setattr("sys.argv", ["compare_results", str(tmp_path)])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == code
    count = 0 if change is None else len(rows)
    assert f"interaction: {count} rows compared" in capsys.readouterr().out
