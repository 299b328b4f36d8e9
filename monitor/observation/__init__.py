"""What every view of a patrol shares: the interface of a source, the fog from heard positions, frame counts, faults."""
