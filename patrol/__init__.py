"""The parts of a patrol that every other package shares.

Terrain and static fields, fog and footprint, the position message, the scenario and the journal's format. It starts
nothing, connects to nothing and decides nothing, and imports none of the other packages.
"""
