"""The script that makes the reference data set."""

from hashlib import sha256

from s2c2a.arm import load_arm
from s2c2a.data import load_recording

from tools import make_reference_data


def test_the_card_names_recordings_and_their_digests(tmp_path, monkeypatch):
    arm = load_arm("twin_arm")
    monkeypatch.setattr(make_reference_data, "reference_arms", lambda: [arm])
    make_reference_data.make_reference_data(tmp_path, seed=3, episodes=2, samples=40)
    recording = load_recording(tmp_path / "twin_arm.episodes")
    assert len(recording.episodes) == 2
    card = (tmp_path / "README.md").read_text(encoding="utf-8")
    digest = sha256((tmp_path / "twin_arm.episodes").read_bytes()).hexdigest()
    assert f"| `twin_arm.episodes` | `{digest}` |" in card
    assert "2 episodes of 40 control steps for each arm, seed 3" in card
    assert load_arm(tmp_path / "twin_arm.toml") == arm


def test_the_reference_arms_have_different_names():
    names = [arm.name for arm in make_reference_data.reference_arms()]
    assert len(set(names)) == len(names) == 8
