"""The paper's tables: our values beside the printed ones."""
