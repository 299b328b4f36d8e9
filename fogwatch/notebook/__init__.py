"""Results of `fogwatch.load`, `run`, `sweep` and `plan` for notebooks and programs, with tables and figures."""
