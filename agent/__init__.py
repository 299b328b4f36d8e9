"""One robot: a pure mind, and the process around it.

The mind turns the robot's own pose and the positions it hears into a command. It has no access to the world simulator,
to the faults or to the truth.
"""
