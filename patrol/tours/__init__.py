"""A short closed tour from which all of some ground is seen."""
