"""The default policy: go to one place until somebody has seen it."""
