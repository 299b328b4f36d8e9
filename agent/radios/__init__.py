"""Radios: the means by which a robot sends and hears positions."""
