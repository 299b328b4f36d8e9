"""Going to one place until a robot has seen it."""
