"""`s2c2a pretrain`: refusals before the long work."""


def test_an_existing_file_is_kept(tmp_path, refusal):
    path = tmp_path / "prior.safetensors"
    path.write_bytes(b"mine")
    assert "add --overwrite" in refusal("pretrain", "--out", str(path))
    assert path.read_bytes() == b"mine"


def test_a_single_arm_is_refused(tmp_path, refusal):
    command = ["pretrain", "--out", str(tmp_path / "prior.safetensors")]
    assert "give 2 arms or more" in refusal(*command, "--arms", "1")
