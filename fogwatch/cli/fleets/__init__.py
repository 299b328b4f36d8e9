"""Commands for running fleets and their members."""
