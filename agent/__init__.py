"""One robot: a pure mind, and the process around it.

The mind turns the robot's own pose and the positions it hears into a command. It knows nothing of the world
simulator, of faults or of the truth.
"""
