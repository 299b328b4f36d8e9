"""Commands of the studies: plans, sweeps, benchmarks, the paper, intruders, random buildings."""

from experiments.commands import (  # noqa: F401 - each adds its commands
    benchmark,
    faults,
    intruder,
    map_random,
    paper,
    plan,
    sweep,
)
