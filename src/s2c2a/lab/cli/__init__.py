"""Commands for servos, trackers and emulators."""
