"""Paths from a robot to every point of the terrain (paper, step 1 of the outline)."""
