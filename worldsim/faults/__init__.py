"""When faults happen, and what they do to the processes of robots."""
