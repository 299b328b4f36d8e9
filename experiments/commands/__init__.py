"""Commands of the studies: sweeps, benchmarks, the paper, intruders."""

from experiments.commands import benchmark, intruder, paper, sweep  # noqa: F401 - each adds its commands
