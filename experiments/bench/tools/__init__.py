"""How the benchmarks take time and memory, what they say of the machine, and how results are written."""
