"""Commands of the studies: plans, sweeps, benchmarks, the paper, intruders, random buildings."""
