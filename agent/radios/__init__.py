"""Radios: how a robot sends and hears positions."""
