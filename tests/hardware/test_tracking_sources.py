"""Sources of true states of a real arm."""

import pytest

from s2c2a.arm import load_arm
from s2c2a.errors import S2C2AError
from s2c2a.hardware.end_tracking import EndTracking
from s2c2a.tracking import NatNetTracker, QualisysTracker, UdpTracker

ARM = load_arm("twin_arm")


@pytest.mark.parametrize(
    ("source", "kind"),
    [
        ("udp", UdpTracker),
        ("udp:9000", UdpTracker),
        ("udp:0.0.0.0:9000", UdpTracker),
        ("natnet", NatNetTracker),
        ("natnet:10.0.0.2", NatNetTracker),
        ("natnet:10.0.0.2:10.0.0.3", NatNetTracker),
        ("natnet:10.0.0.2:10.0.0.3:z", NatNetTracker),
        ("qualisys", QualisysTracker),
        ("qualisys:10.0.0.2", QualisysTracker),
    ],
)
def test_a_source_gives_its_tracker(source, kind):
    tracking = EndTracking(ARM, source)
    assert type(tracking._tracker) is kind
    assert set(tracking.sensors) == {"states"}


@pytest.mark.parametrize(
    "source", ["vicon", "udp:", "udp:a", "udp:a:b:1", "natnet::a", "natnet:a:b:z:1"]
)
def test_an_invalid_source_lists_all(source):
    with pytest.raises(S2C2AError, match="udp:HOST:PORT, natnet, natnet:HOST"):
        EndTracking(ARM, source)


def test_an_invalid_up_axis_is_refused():
    with pytest.raises(S2C2AError, match="give y or z"):
        EndTracking(ARM, "natnet:a:b:x")


def test_an_arm_is_not_opened_without_poses(monkeypatch):
    monkeypatch.setattr("s2c2a.hardware.end_tracking.FIRST_POSES", 0.1)
    tracking = EndTracking(ARM, "udp:0")
    try:
        with pytest.raises(S2C2AError, match="no poses of all module ends arrived"):
            tracking.start()
    finally:
        tracking.close()
