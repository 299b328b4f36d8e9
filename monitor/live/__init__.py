"""Sources for running fleets."""
