"""Terrains read from map files, and the built-in ones."""
