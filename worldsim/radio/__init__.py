"""The simulated radio: what reaches whom, and what faults do to it."""
