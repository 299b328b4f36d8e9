"""The measures of the benchmarks: kernels, decisions, fleets, processes, the horizon, and what grows with a fleet."""
