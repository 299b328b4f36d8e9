"""The live table, the summary and the bar that a run shows on a terminal."""
