"""A run that is over, played again from its folder."""
