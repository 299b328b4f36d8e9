"""Reports of a process about itself: log, health, metrics, and its watchdog."""
