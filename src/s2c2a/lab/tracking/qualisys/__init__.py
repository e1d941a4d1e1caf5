"""Poses from Qualisys Track Manager over its real-time (RT) protocol."""

from s2c2a.lab.tracking.qualisys.tracker import QualisysTracker
