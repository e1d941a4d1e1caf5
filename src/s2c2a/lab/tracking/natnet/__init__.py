"""Poses from OptiTrack Motive over NatNet."""

from s2c2a.lab.tracking.natnet.tracker import NatNetTracker
