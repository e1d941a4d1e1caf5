"""Options of `s2c2a emulate` that contradict each other."""

import pytest

from s2c2a.cli.main import main


def test_a_version_of_json_datagrams_is_refused(capsys):
    with pytest.raises(SystemExit):
        main(["emulate", "mocap", "--protocol", "udp", "--version", "4.1"])
    assert "udp has no versions; leave it out" in capsys.readouterr().err
