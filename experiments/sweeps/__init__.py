"""Sweeps: the plan of many runs, the workers that make them, and the results."""
