"""Faults: their kinds, whom they befall, and the random ones."""
