"""`s2c2a pretrain`: refusals before the long work."""

import pytest

from s2c2a.cli.main import main


def refused(arguments: list[str], capsys) -> str:
    with pytest.raises(SystemExit) as exit_info:
        main(["pretrain", *arguments])
    assert exit_info.value.code == 2
    return capsys.readouterr().err


def test_an_existing_file_is_kept(tmp_path, capsys):
    path = tmp_path / "prior.safetensors"
    path.write_bytes(b"mine")
    assert "add --overwrite" in refused(["--out", str(path)], capsys)
    assert path.read_bytes() == b"mine"


def test_a_single_arm_is_refused(tmp_path, capsys):
    out = str(tmp_path / "prior.safetensors")
    assert "give 2 arms or more" in refused(["--out", out, "--arms", "1"], capsys)
