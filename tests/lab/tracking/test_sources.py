"""Trackers by name."""

import pytest

from s2c2a.errors import S2C2AError
from s2c2a.lab.tracking import NatNetTracker, UdpTracker, tracker_of
from s2c2a.plugins.discovery import trust_code

OWN = """
from s2c2a.lab.tracking import Tracker

class Mine(Tracker):
    def __init__(self, gain: float = 1.0):
        self.gain = gain
    def start(self): pass
    def latest(self): return None
    def close(self): pass

class Needy(Mine):
    def __init__(self, device: str):
        self.device = device

class NoTracker: pass
"""


@pytest.mark.parametrize(
    ("source", "kind"),
    [
        ("udp", UdpTracker),
        ("udp:9000", UdpTracker),
        ("udp:0.0.0.0:9000", UdpTracker),
        ("natnet", NatNetTracker),
        ("natnet:10.0.0.2", NatNetTracker),
        ("natnet:10.0.0.2,local=10.0.0.3,up=z,data_port=1611", NatNetTracker),
    ],
)
def test_a_source_gives_its_tracker(source, kind):
    assert type(tracker_of(source)) is kind


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("vicon", "no tracker 'vicon'"),
        ("optitrack:1.2.3.4", "is no tracking source; give udp"),
        ("udp:", "udp:HOST:PORT, natnet:HOST"),
        ("udp:a", "option port=a of UdpTracker: write a whole number"),
        ("udp:a:b:1", "no tracking source"),
        ("natnet::a", "no tracking source"),
        ("camera:0", "camera:DEVICE:CAMERA_FILE"),
        ("camera:0:no.json", "no.json"),
        ("natnet:a,up", "write key=value"),
        ("natnet:a,gain=3", "has no option 'gain'"),
        ("natnet:a,up=x", "give y or z"),
        ("udp:99999", "choose 0 to 65535"),
    ],
)
def test_an_invalid_source_is_explained(source, message):
    with pytest.raises(S2C2AError, match=message):
        tracker_of(source)


def test_a_users_own_tracker_is_found_by_its_file(tmp_path):
    path = tmp_path / "own_tracker_of_a_test.py"
    path.write_text(OWN)
    trust_code(*(f"{path}:{name}" for name in ("Mine", "Needy", "NoTracker")))
    assert tracker_of(f"{path}:Mine,gain=2").gain == 2.0
    with pytest.raises(S2C2AError, match=r"Needy cannot be made.*'device'"):
        tracker_of(f"{path}:Needy")
    with pytest.raises(S2C2AError, match="not a tracker"):
        tracker_of(f"{path}:NoTracker")
