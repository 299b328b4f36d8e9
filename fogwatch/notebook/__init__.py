"""What notebooks and programs get from `fogwatch.load`, `run`, `sweep` and `plan`: results with tables and figures."""
