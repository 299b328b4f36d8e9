"""Zones: ground that matters more or less, that is slow, or that no body may enter."""
