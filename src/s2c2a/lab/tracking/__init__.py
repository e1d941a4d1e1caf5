"""Pose tracking: poses of module ends from motion capture or cameras. NumPy only."""

from s2c2a.lab.tracking.calibration import TrackingCalibration
from s2c2a.lab.tracking.datagrams import DropReason
from s2c2a.lab.tracking.natnet import NatNetTracker
from s2c2a.lab.tracking.poses import Pose, PoseError, TrackingError
from s2c2a.lab.tracking.qualisys import QualisysTracker
from s2c2a.lab.tracking.receiving import ReceivingTracker, TrackerCounts
from s2c2a.lab.tracking.sources import tracker_of
from s2c2a.lab.tracking.states import ModuleEnds
from s2c2a.lab.tracking.tracked_robot import TrackedRobot
from s2c2a.lab.tracking.tracker import PoseFrame, Tracker
from s2c2a.lab.tracking.udp import UdpTracker
