"""Surrounding an intruder."""
