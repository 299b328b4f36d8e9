"""The front door of the project.

The command `fogwatch`, the launcher that runs a fleet as separate processes, the router between them, the
run folder and the pictures.
"""
