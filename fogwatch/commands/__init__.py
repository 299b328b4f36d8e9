"""Commands that show or record a run."""
