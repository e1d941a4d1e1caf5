"""An export that cannot be written names the place that the user gave."""

import pytest

from s2c2a.cli.export import export
from s2c2a.errors import S2C2AError

NEEDS = {
    "csv": "numpy",
    "lerobot": "pyarrow",
    "mcap": "foxglove",
    "npz": "numpy",
    "parquet": "pyarrow",
}


@pytest.mark.slow
@pytest.mark.parametrize("form", NEEDS)
def test_an_error_names_no_temporary_path(form, recording, tmp_path):
    pytest.importorskip(NEEDS[form])
    out = tmp_path / ("n" * 250)  # the name of a temporary path is longer
    with pytest.raises(S2C2AError, match=f"cannot write {out}: ") as caught:
        export(recording, out, form)
    assert ".part" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []
