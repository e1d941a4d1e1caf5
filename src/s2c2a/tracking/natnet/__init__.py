"""Poses from OptiTrack Motive over NatNet."""

from s2c2a.tracking.natnet.tracker import NatNetTracker
