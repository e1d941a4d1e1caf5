"""Log files: valid tables are read, invalid or malicious ones are errors."""

import gzip
import pickle
import zipfile

import numpy as np
import pytest
from scipy.io import savemat

from s2c2a.logs.errors import LogError
from s2c2a.logs.reading import read_here, read_table
from s2c2a.logs.tables import ColumnRequest

AB = ColumnRequest(["a", "b"])


@pytest.fixture(params=["npz", "mat"])
def stored(request, tmp_path):
    """Function that stores arrays in a file of either form, and returns its path."""

    def store(values):
        path = tmp_path / f"log.{request.param}"
        np.savez(path, **values) if path.suffix == ".npz" else savemat(path, values)
        return path

    return store


@pytest.mark.parametrize(
    "content",
    [
        "a\tb\n1,5\t2\n-3\t4e-1\n",
        "\ufeffa,b\r\n1.5,2\r\n\r\n-3,.4\r\n",
        "# made by hand\nb,a\n2,1.5\n# and on\n0.4,-3\n",
        '"a", "b"\n1.5, 2\n-3, 0.4\n',
    ],
)
def test_a_table_is_read_with_any_marks_quotes_and_line_ends(written, content):
    numbers = read_table(written(content), AB).numbers
    np.testing.assert_array_equal([numbers["a"], numbers["b"]], [[1.5, -3], [2, 0.4]])


def test_blank_cells_are_nan_and_labels_stay_text(written):
    path = written("a,b,what\n1,,up\nNaN,n/a,down\n")
    table = read_table(path, ColumnRequest(["a", "b"], ["what"]))
    np.testing.assert_array_equal(table.numbers["b"], [np.nan, np.nan])
    assert list(table.labels["what"]) == ["up", "down"]


@pytest.mark.parametrize(
    ("content", "place"),
    [
        ("a,b\n1,2\n3,high\n", "line 3, column 'b'.*'high'"),
        ("a,b\n1,2\n3\n", "line 3, column 'b'.*cut off"),
        ("a,b,c\n1,2,3\n1,2\n", "line 3, column 'c'.*cut off"),
        ('a,b\n"1,5",2\n', "line 2, column 'a'"),
        ("a;b\n1.234,5;2\n", "line 2, column 'a'"),
        ("a,b\n1_000,2\n", "line 2, column 'a'"),
    ],
)
def test_a_broken_row_is_an_error_with_line_and_column_or_a_gap(
    written, content, place
):
    path = written(content)
    with pytest.raises(LogError, match=place):
        read_table(path, AB)
    table = read_table(path, ColumnRequest(["a", "b"], allow_broken_rows=True))
    assert table.broken_rows == 1
    assert np.isnan(table.numbers["a"][-1])


@pytest.mark.parametrize(
    "content",
    [
        b"c,d\n1,2\n",
        b"a,a\n1,2\n",
        gzip.compress(b"a,b\n1,2\n", mtime=0)[:-9],
        b"\x1f\x8bnothing",
        b'a,b\n"1,2\n' + b"x" * 200_000,
        b"\xff\xfea",
    ],
)
def test_a_file_without_a_table_is_an_error(written, content):
    with pytest.raises(LogError):
        read_table(written(content), AB)


def test_skipped_lines_are_named_where_the_header_was_among_them(written):
    request = ColumnRequest(["a"], skip_lines=1)
    told = r"below the 1 lines that rows\.skip_lines skips"
    with pytest.raises(LogError, match=told):
        read_table(written("a,b\n1,2\n3,4\n"), request)


def test_arrays_are_columns_by_name_and_number(stored):
    path = stored({"a": np.arange(3.0), "p": np.arange(6.0).reshape(3, 2)})
    numbers = read_table(path, ColumnRequest(["a", "p.1"])).numbers
    np.testing.assert_array_equal(
        [numbers["a"], numbers["p.1"]], [[0, 1, 2], [1, 3, 5]]
    )


@pytest.mark.parametrize("shape", [(0,), (0, 0), (0, 3), (3, 0)])
def test_an_array_without_values_beside_the_columns_is_left_out(stored, shape):
    table = read_table(stored({"a": np.arange(3.0), "notes": np.zeros(shape)}), AB)
    assert list(table.numbers) == ["a"]
    assert len(table) == 3


def test_infinite_values_are_missing_whatever_the_format(stored, written):
    array = stored({"a": np.array([1.0, np.inf, -np.inf, np.nan])})
    for path in (array, written("a\n1\ninf\n-inf\nnan\n")):
        numbers = read_table(path, AB).numbers["a"]
        np.testing.assert_array_equal(numbers, [1.0, np.nan, np.nan, np.nan])


def test_text_where_numbers_are_expected_is_an_error_with_its_column(stored):
    path = stored({"a": np.array(["up", "down"]), "b": np.arange(2.0)})
    with pytest.raises(LogError, match="column 'a' holds text"):
        read_table(path, AB)


class Trap:
    """Object that writes a file when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return open, (str(self.path), "w")


def test_pickled_objects_in_an_npz_file_are_never_loaded(tmp_path):
    sprung = tmp_path / "sprung"
    path = tmp_path / "log.npz"
    np.savez(path, a=np.array([Trap(sprung)], dtype=object), allow_pickle=True)
    with pytest.raises(LogError):
        read_table(path, AB)
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("a.npy", pickle.dumps(Trap(sprung)))
    with pytest.raises(LogError):
        read_table(path, AB)
    assert not sprung.exists()


def test_a_mat_file_of_version_7_3_is_refused_with_advice(written):
    with pytest.raises(LogError, match="-v7"):
        read_table(written(b"MATLAB 7.3 MAT-file".ljust(200), "log.mat"), AB)


@pytest.mark.parametrize("ending", ["npz", "mat", "csv.gz"])
def test_damaged_files_are_errors(tmp_path, ending):
    random = np.random.default_rng(0)
    path = tmp_path / f"log.{ending}"
    values = {"a": random.normal(size=20), "b": random.normal(size=20)}
    if ending == "npz":
        np.savez_compressed(path, **values)
    elif ending == "mat":
        savemat(path, values, do_compression=True)
    else:
        rows = zip(values["a"], values["b"], strict=True)
        lines = ["a,b", *(f"{a},{b}" for a, b in rows)]
        path.write_bytes(gzip.compress("\n".join(lines).encode(), mtime=0))
    content = path.read_bytes()
    errors = 0
    count = 8 if ending == "mat" else 150  # a process each
    for _ in range(count):
        damaged = bytearray(content)
        if random.random() < 0.3:
            damaged = damaged[: random.integers(1, len(content))]
        damaged[random.integers(len(damaged))] ^= random.integers(1, 256)
        path.write_bytes(bytes(damaged))
        try:
            # SciPy's reader may end the process
            (read_table if ending == "mat" else read_here)(path, AB)
        except LogError:
            errors += 1
    assert errors > count / 8


@pytest.mark.parametrize(
    "values",
    [
        {"t": np.arange(5.0), "p": np.arange(15.0).reshape(5, 3)},
        {"t": np.arange(5.0), "p": np.arange(15.0).reshape(5, 3).T},
        {"t": np.arange(5.0).reshape(1, 5), "p": np.arange(15.0).reshape(5, 3).T},
        {"u": np.zeros((2, 5)), "p": np.arange(15.0).reshape(5, 3).T},
        {"p": np.arange(15.0).reshape(5, 3).T},
    ],
)
def test_arrays_of_channels_by_samples_are_transposed(stored, values):
    names = ["t", "u.0", "p.0", "p.1", "p.2"]
    numbers = read_table(stored(values), ColumnRequest(names)).numbers
    np.testing.assert_array_equal(numbers["p.1"], [1, 4, 7, 10, 13])


def test_an_array_that_may_be_read_in_two_ways_is_refused_with_the_way_out(stored):
    path = stored({"p": np.zeros((3, 5))})
    with pytest.raises(LogError, match=r"'p' is 3 x 5, .* such as p = p\.'"):
        read_table(path, ColumnRequest(["p.0", "p.1"]))


@pytest.mark.parametrize("delimiter", [",", ";", "\t", "  "])
def test_more_cells_than_names_are_an_error_with_the_line(written, delimiter):
    """The columns of such rows may have shifted."""
    text = "a,b\n1,2,3,4\n5,6,7,8".replace(",", delimiter)
    told = "line 2, it has 4 cells, and the header 2 names"
    with pytest.raises(LogError, match=told):
        read_table(written(text), AB)


def test_a_longer_row_of_a_sheet_is_an_error_with_its_number(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    for row in (["a", "b", None], [1, 2, None], [3, 4, 5]):
        book.active.append(row)
    book.save(tmp_path / "log.xlsx")
    with pytest.raises(LogError, match="row 3, it has 3 cells, and the header 2 names"):
        read_table(tmp_path / "log.xlsx", AB)


def test_a_blank_cell_at_the_end_of_rows_is_no_column(written):
    table = read_table(written("a,b\n1,2,\n3,4, \n"), AB)
    np.testing.assert_array_equal(table.numbers["b"], [2.0, 4.0])
