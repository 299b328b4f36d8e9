"""Faults: their kinds, their targets, and the nemesis's settings."""
