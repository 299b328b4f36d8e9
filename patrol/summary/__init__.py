"""The metrics of a run: each declared once, computed from the journal, and read back from summary.json."""
