"""How fast fogwatch is: kernels, decisions, fleets, start-up, memory, and what a horizon of hearing changes."""
