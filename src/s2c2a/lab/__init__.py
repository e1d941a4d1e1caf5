"""Wing for a lab: servos, trackers, and emulators of both. The core never imports it."""
