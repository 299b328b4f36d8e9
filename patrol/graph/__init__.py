"""Graphs of places: what the patrols of the literature run on, and by which they are measured.

A graph is read from a `.graph` file (`graph_file`) or made from the ground (`from_ground`). Fogwatch's own policies do
not need one.
"""
