"""Whole fleets in one process.

Minds and world side by side, without Zenoh, with the same trace as separate processes give, bit for bit.
"""
