"""Convex regions: the ground split into a few pieces and the points that connect them."""
