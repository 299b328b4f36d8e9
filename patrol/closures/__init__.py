"""Closures: doors and boxes, ground that is closed at times."""
