"""Commands that run many runs: experiments, sweeps, the paper."""
