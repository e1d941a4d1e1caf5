"""Files of logs."""

import pytest


@pytest.fixture
def written(tmp_path):
    """Function that writes a file and returns its path."""

    def write(content, name="log.csv"):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write
