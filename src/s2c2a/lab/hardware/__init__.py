"""Real arms: servo buses, winches, calibration, bring-up, and the robot above them."""
