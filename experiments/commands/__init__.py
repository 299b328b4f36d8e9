"""Commands of the studies: plans, sweeps, benchmarks, the paper, intruders."""

from experiments.commands import benchmark, intruder, paper, plan, sweep  # noqa: F401 - each adds its commands
