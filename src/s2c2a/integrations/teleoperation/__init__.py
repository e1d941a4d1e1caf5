"""Teleoperation: a person moves the target of an arm, and demonstrations are recorded."""
