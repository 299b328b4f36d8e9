"""Grounds before a run: what bodies reach on a map, what zones and closures do to it, where it lies on another."""
