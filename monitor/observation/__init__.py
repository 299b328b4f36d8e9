"""Shared by all views of a patrol: the interface of a source, the fog from heard positions, frames, faults."""
