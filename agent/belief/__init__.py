"""The belief of one robot: the fog, the other robots, and intruders."""
