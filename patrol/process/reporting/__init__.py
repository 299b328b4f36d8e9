"""What a process shows of itself: log, health, metrics, and its watchdog."""
