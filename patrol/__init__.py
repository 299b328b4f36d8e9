"""The parts of a patrol that every other package shares.

Terrain and static fields, fog and footprint, the position message, the scenario, the journal's format, and
the one link to Zenoh. It starts nothing and decides nothing, and imports none of the other packages.
"""
