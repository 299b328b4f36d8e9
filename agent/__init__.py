"""One robot: the pure mind that turns its own pose and the positions it hears into a command, and the
process around that mind. It knows nothing of the world simulator, of faults or of the truth."""
