"""Studies with whole fleets in one process: sweeps, the paper's tables, the cost of faults.

Minds and world run side by side, without Zenoh, with the same trace as separate processes, bit for bit.
"""
