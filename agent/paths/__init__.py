"""Paths from where a robot stands to every point of the terrain (paper, step 1 of the outline).

Every method leaves the same three grids over a window of the ground: which points have a path, how long it is, and
where it first bends.
"""

from agent.paths.window import Window

__all__ = ["Window"]
