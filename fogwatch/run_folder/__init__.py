"""The run folder, and the files in it that are made when a run has ended."""
