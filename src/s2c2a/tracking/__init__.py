"""Pose tracking: poses of module ends from motion capture or cameras. NumPy only."""

from s2c2a.tracking.calibration import TrackingCalibration
from s2c2a.tracking.datagrams import DropReason
from s2c2a.tracking.natnet import NatNetTracker
from s2c2a.tracking.poses import Pose, PoseError, TrackingError
from s2c2a.tracking.qualisys import QualisysTracker
from s2c2a.tracking.sources import tracker_of
from s2c2a.tracking.states import ModuleEnds, TrackedStates
from s2c2a.tracking.tracked_robot import TrackedRobot
from s2c2a.tracking.tracker import PoseFrame, Tracker
from s2c2a.tracking.udp import DatagramCounts, UdpTracker
