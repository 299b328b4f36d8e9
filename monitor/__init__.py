"""Reserved for watching a patrol from outside; it holds no code yet.

What a run shows today comes from `fogwatch`: the live table, the final picture and the run folder.
"""
