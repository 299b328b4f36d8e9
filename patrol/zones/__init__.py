"""Zones: ground that matters more or less, that is slow or one-way, or that no body may enter."""
