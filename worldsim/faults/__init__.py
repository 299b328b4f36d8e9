"""The times of faults, and their effects on the processes of robots."""
