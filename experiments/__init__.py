"""Whole fleets in one process, and what is built on them: sweeps, the paper's tables, the cost of faults.

Minds and world run side by side, without Zenoh, with the same trace as separate processes, bit for bit.
"""
