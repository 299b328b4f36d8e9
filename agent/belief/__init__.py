"""What one robot believes: the fog, the other robots, and intruders."""
