"""Whole fleets in one process: minds and world side by side, without Zenoh, with the same trace as the
separate processes give, bit for bit."""
