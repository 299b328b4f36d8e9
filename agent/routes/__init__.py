"""Paths from where a robot stands to every point of the terrain (paper, step 1 of the outline)."""
