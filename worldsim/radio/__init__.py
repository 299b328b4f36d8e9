"""The simulated radio: the frames that reach each robot, and the effects of faults on them."""
