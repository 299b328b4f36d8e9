"""Commands of the studies: plans, sweeps, benchmarks, the paper, intruders, random buildings."""

from experiments.commands import benchmark, faults, intruder, map_random, paper, plan, sweep  # noqa: F401 - each adds its commands
