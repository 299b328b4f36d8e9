"""The default policy: go to one place until a robot has seen it."""
