"""The verdict on a run: the judge puts its journal through the checks, which are in `worldsim.checks`."""
